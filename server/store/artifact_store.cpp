#include "server/store/artifact_store.h"

#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

#include "server/store/file_failure.h"

namespace remesh {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kDraftPrefix = ".draft-";
constexpr std::string_view kDamagedPrefix = ".damaged-";
// Bytes that are looked at between two checkpoints.
constexpr std::size_t kBlock = std::size_t{4} << 20U;

void sync_directory(const fs::path& path) {
    const int file = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file < 0 || ::fsync(file) != 0) {
        fail("can't sync the artifact directory");
    }
    ::close(file);
}

/// Whether the process that writes a draft is still there.
bool is_being_written(const fs::path& draft) {
    const int file = ::open(draft.c_str(), O_RDONLY | O_CLOEXEC);
    const bool is_locked = file >= 0 && ::flock(file, LOCK_EX | LOCK_NB) != 0;
    if (file >= 0) {
        ::close(file);
    }
    return is_locked;
}

StoreError lost(const std::string& sha256) {
    return StoreError("store: the bytes of artifact " + sha256 + " are gone or damaged",
                      StoreError::Kind::Lost);
}

fs::path directory_of(const fs::path& data_dir, const std::string& tenant) {
    return data_dir / "tenants" / tenant / "artifacts";
}

fs::path made_directory_of(const fs::path& data_dir, const std::string& tenant) {
    fs::path directory = directory_of(data_dir, tenant);
    std::error_code error;
    fs::create_directories(directory, error);
    if (error) {
        errno = error.value();
        fail("can't make the artifact directory");
    }
    return directory;
}

}  // namespace

ArtifactDraft::ArtifactDraft(std::string tenant, fs::path path)
    : tenant_(std::move(tenant)), path_(std::move(path)) {
    file_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (file_ < 0) {
        fail("can't create an artifact");
    }
    ::flock(file_, LOCK_SH | LOCK_NB);
}

ArtifactDraft::ArtifactDraft(std::string tenant, fs::path path, ArtifactId id)
    : tenant_(std::move(tenant)), path_(std::move(path)), id_(std::move(id)) {}

ArtifactDraft::ArtifactDraft(ArtifactDraft&& other) noexcept
    : tenant_(std::move(other.tenant_)),
      path_(std::exchange(other.path_, {})),
      file_(std::exchange(other.file_, -1)),
      id_(std::move(other.id_)),
      hash_(std::move(other.hash_)) {}

ArtifactDraft::~ArtifactDraft() {
    if (file_ >= 0) {
        ::close(file_);
    }
    if (!path_.empty()) {
        ::unlink(path_.c_str());
    }
}

void ArtifactDraft::write(std::string_view bytes) {
    hash_.add(bytes);
    id_.size += static_cast<std::int64_t>(bytes.size());
    while (!bytes.empty()) {
        const ssize_t written = ::write(file_, bytes.data(), bytes.size());
        if (written < 0 && errno != EINTR) {
            fail("can't write an artifact");
        }
        bytes.remove_prefix(written < 0 ? 0 : static_cast<std::size_t>(written));
    }
}

const ArtifactId& ArtifactDraft::finish() {
    if (::fsync(file_) != 0) {
        fail("can't sync an artifact");
    }
    id_.sha256 = hash_.finish();
    return id_;
}

ArtifactFile::ArtifactFile(ArtifactFile&& other) noexcept
    : sha256_(std::move(other.sha256_)), file_(std::exchange(other.file_, -1)) {}

ArtifactFile::~ArtifactFile() {
    if (file_ >= 0) {
        ::close(file_);
    }
}

void ArtifactFile::read(std::int64_t offset, std::size_t size, std::string& bytes) const {
    bytes.resize(size);
    for (std::size_t done = 0; done < size;) {
        const ssize_t got = ::pread(file_, bytes.data() + done, size - done,
                                    offset + static_cast<std::int64_t>(done));
        if (got < 0 && errno != EINTR) {
            fail("can't read an artifact");
        }
        if (got == 0) {
            throw lost(sha256_);
        }
        done += got < 0 ? 0 : static_cast<std::size_t>(got);
    }
}

ArtifactView::ArtifactView(ArtifactView&& other) noexcept
    : file_(std::move(other.file_)), bytes_(std::exchange(other.bytes_, {})) {}

ArtifactView::~ArtifactView() {
    if (!bytes_.empty()) {
        ::munmap(const_cast<char*>(bytes_.data()), bytes_.size());
    }
}

/// The right to change files and records together.
class ArtifactStore::Exclusive {
public:
    explicit Exclusive(ArtifactStore& artifacts) : artifacts_(artifacts), lock_(artifacts.mutex_) {
        while (::flock(artifacts_.lock_file_, LOCK_EX) != 0) {
            if (errno != EINTR) {
                fail("can't lock the artifacts");
            }
        }
    }
    Exclusive(const Exclusive&) = delete;
    Exclusive& operator=(const Exclusive&) = delete;
    ~Exclusive() { ::flock(artifacts_.lock_file_, LOCK_UN); }

private:
    ArtifactStore& artifacts_;
    std::scoped_lock<std::mutex> lock_;
};

ArtifactStore::ArtifactStore(fs::path data_dir, JobStore& store)
    : data_dir_(std::move(data_dir)), store_(store), checkpoints_(data_dir_) {
    const fs::path file = data_dir_ / "artifacts.lock";
    lock_file_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (lock_file_ < 0) {
        fail("can't open the lock of the artifacts");
    }
}

ArtifactStore::~ArtifactStore() {
    ::close(lock_file_);
}

ArtifactDraft ArtifactStore::draft(const std::string& tenant) {
    const fs::path directory = made_directory_of(data_dir_, tenant);
    const Exclusive lock(*this);  // a collector doesn't see it before its writer has locked it
    return {tenant, directory / (std::string(kDraftPrefix) + random_hex(16))};
}

ArtifactDraft ArtifactStore::adopt(const std::string& tenant, const fs::path& file,
                                   const ArtifactId& artifact) {
    made_directory_of(data_dir_, tenant);
    return {tenant, file, artifact};
}

void ArtifactStore::publish(std::vector<ArtifactDraft> drafts,
                            const std::function<void()>& record) {
    const Exclusive lock(*this);
    for (ArtifactDraft& draft : drafts) {
        const fs::path path = path_of(draft.tenant_, draft.id_.sha256);
        if (::rename(draft.path_.c_str(), path.c_str()) != 0) {
            fail("can't put an artifact in its place");
        }
        draft.path_.clear();
        ::unlink(damaged_path_of(draft.tenant_, draft.id_.sha256).c_str());
    }
    if (!drafts.empty()) {
        sync_directory(directory_of(data_dir_, drafts.front().tenant_));
    }
    const auto take_back_unrecorded = [&] {
        for (const ArtifactDraft& draft : drafts) {
            if (!find(draft.tenant_, draft.id_.sha256)) {
                ::unlink(path_of(draft.tenant_, draft.id_.sha256).c_str());
            }
        }
    };
    try {
        record();
    } catch (...) {
        take_back_unrecorded();
        throw;
    }
    take_back_unrecorded();
}

bool ArtifactStore::add(ArtifactDraft draft, Time now, std::optional<std::int64_t> max_bytes) {
    const std::string tenant = draft.tenant_;
    const ArtifactId artifact = draft.id_;
    std::vector<ArtifactDraft> drafts;
    drafts.push_back(std::move(draft));
    bool is_added = false;
    publish(std::move(drafts),
            [&] { is_added = store_.add_artifact(tenant, artifact, max_bytes, now); });
    return is_added;
}

std::optional<std::int64_t> ArtifactStore::room_of(const std::string& tenant,
                                                   std::optional<std::int64_t> max_bytes) const {
    const auto policy = store_.policy(tenant);
    const auto limit = policy.max_bytes ? policy.max_bytes : max_bytes;
    return limit ? std::optional(*limit - store_.stored_bytes(tenant)) : std::nullopt;
}

std::optional<ArtifactId> ArtifactStore::find(const std::string& tenant,
                                              const std::string& sha256) const {
    return store_.find_artifact(tenant, sha256);
}

std::optional<ArtifactId> ArtifactStore::find_whole(const std::string& tenant,
                                                    const std::string& sha256) const {
    auto known = find(tenant, sha256);
    struct stat status {};
    if (known && ::stat(path_of(tenant, sha256).c_str(), &status) != 0) {
        if (errno != ENOENT) {
            fail("can't look at an artifact");
        }
        return std::nullopt;
    }
    return known && status.st_size == known->size ? known : std::nullopt;
}

ArtifactFile ArtifactStore::open_file(const std::string& tenant, const ArtifactId& artifact) const {
    ArtifactFile file(artifact.sha256,
                      ::open(path_of(tenant, artifact.sha256).c_str(), O_RDONLY | O_CLOEXEC));
    if (file.file_ < 0 && errno != ENOENT) {
        fail("can't open an artifact");
    }
    struct stat status {};
    if (file.file_ < 0 || ::fstat(file.file_, &status) != 0 || status.st_size != artifact.size) {
        throw lost(artifact.sha256);
    }
    return file;
}

ArtifactView ArtifactStore::open(const std::string& tenant, const ArtifactId& artifact) const {
    ArtifactFile file = open_file(tenant, artifact);
    const auto size = static_cast<std::size_t>(artifact.size);
    void* bytes = nullptr;
    if (size > 0) {
        bytes = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.file_, 0);
    }
    if (bytes == MAP_FAILED) {
        fail("can't map an artifact");
    }
    return {std::move(file), {static_cast<const char*>(bytes), size}};
}

void ArtifactStore::set_aside(const std::string& tenant, const ArtifactFile& file) {
    const Exclusive lock(*this);
    const fs::path path = path_of(tenant, file.sha256_);
    struct stat ours {};
    struct stat named {};
    // Whole bytes may have taken its place meanwhile.
    if (::fstat(file.file_, &ours) != 0 || ::stat(path.c_str(), &named) != 0 ||
        ours.st_ino != named.st_ino || ours.st_dev != named.st_dev) {
        return;
    }
    if (::rename(path.c_str(), damaged_path_of(tenant, file.sha256_).c_str()) != 0) {
        fail("can't set an artifact aside");
    }
    sync_directory(directory_of(data_dir_, tenant));
}

void ArtifactStore::require_whole(const std::string& tenant, const ArtifactView& view,
                                  const std::function<void()>& checkpoint) {
    Sha256 hash;
    for (std::string_view rest = view.bytes(); !rest.empty();
         rest.remove_prefix(std::min(kBlock, rest.size()))) {
        checkpoint();
        hash.add(rest.substr(0, kBlock));
    }
    if (hash.finish() != view.file_.sha256_) {
        set_aside(tenant, view.file_);
        throw lost(view.file_.sha256_);
    }
}

void ArtifactStore::remove_unneeded(const std::string& tenant,
                                    const std::vector<std::string>& digests) {
    const Exclusive lock(*this);
    for (const std::string& sha256 : digests) {
        if (store_.remove_artifact(tenant, sha256)) {
            ::unlink(path_of(tenant, sha256).c_str());
            ::unlink(damaged_path_of(tenant, sha256).c_str());
        }
    }
}

void ArtifactStore::collect_garbage(Time before) {
    for (const JobKey& artifact : store_.unreferenced_artifacts(before)) {
        remove_unneeded(artifact.tenant, {artifact.id});
    }
    checkpoints_.collect_garbage([this](const JobKey& key) {
        const auto job = store_.find(key);
        return job && !is_terminal(job->state);
    });
    if (!fs::exists(data_dir_ / "tenants")) {
        return;
    }
    for (const auto& tenant : fs::directory_iterator(data_dir_ / "tenants")) {
        const fs::path directory = tenant.path() / "artifacts";
        if (!fs::exists(directory)) {
            continue;
        }
        const Exclusive lock(*this);
        for (const auto& file : fs::directory_iterator(directory)) {
            std::string name = file.path().filename().string();
            if (name.starts_with(kDamagedPrefix)) {
                name.erase(0, kDamagedPrefix.size());
            }
            if (name.starts_with(kDraftPrefix)
                    ? !is_being_written(file.path())
                    : is_sha256(name) && !find(tenant.path().filename().string(), name)) {
                ::unlink(file.path().c_str());
            }
        }
    }
}

fs::path ArtifactStore::path_of(const std::string& tenant, const std::string& sha256) const {
    return directory_of(data_dir_, tenant) / sha256;
}

fs::path ArtifactStore::damaged_path_of(const std::string& tenant,
                                        const std::string& sha256) const {
    return directory_of(data_dir_, tenant) / (std::string(kDamagedPrefix) + sha256);
}

}  // namespace remesh
