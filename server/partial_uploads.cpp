#include "server/partial_uploads.h"

#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <iterator>
#include <unistd.h>
#include <utility>
#include <vector>

#include "server/store/file_failure.h"

namespace remesh {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kUnkeptPrefix = ".unkept-";
constexpr std::size_t kReadBytes = std::size_t{1} << 20U;

/// Opens and locks the file of that name; -1 if somebody else has it.
int open_locked(const fs::path& path) {
    while (true) {
        const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
        if (file < 0) {
            fail("can't open an upload");
        }
        if (::flock(file, LOCK_EX | LOCK_NB) != 0) {
            ::close(file);
            return -1;
        }
        // Whoever had the lock may have given the file away: then the name means another one.
        struct stat ours {};
        struct stat named {};
        if (::fstat(file, &ours) == 0 && ::stat(path.c_str(), &named) == 0 &&
            ours.st_ino == named.st_ino && ours.st_dev == named.st_dev) {
            return file;
        }
        ::close(file);
    }
}

std::int64_t size_of(int file) {
    struct stat status {};
    if (::fstat(file, &status) != 0) {
        fail("can't look at an upload");
    }
    return status.st_size;
}

}  // namespace

PartialUpload::PartialUpload(fs::path path, int file, bool is_kept)
    : path_(std::move(path)), file_(file), is_kept_(is_kept) {}

PartialUpload::PartialUpload(PartialUpload&& other) noexcept
    : path_(std::exchange(other.path_, {})),
      announced_(std::move(other.announced_)),
      file_(std::exchange(other.file_, -1)),
      is_kept_(other.is_kept_),
      size_(other.size_),
      hash_(std::move(other.hash_)) {}

PartialUpload::~PartialUpload() {
    if (!path_.empty() && (!is_kept_ || size_ == 0)) {
        ::unlink(path_.c_str());
    }
    if (file_ >= 0) {
        ::close(file_);
    }
}

// Reads what came before, for the digest.
void PartialUpload::take_up() {
    std::vector<char> buffer(kReadBytes);
    ssize_t got = 0;
    while ((got = ::read(file_, buffer.data(), buffer.size())) > 0) {
        hash_.add({buffer.data(), static_cast<std::size_t>(got)});
        size_ += got;
    }
    if (got < 0) {
        fail("can't read an upload");
    }
}

void PartialUpload::write(std::string_view bytes) {
    hash_.add(bytes);
    while (!bytes.empty()) {
        const ssize_t written = ::write(file_, bytes.data(), bytes.size());
        if (written < 0 && errno != EINTR) {
            is_kept_ = false;  // On a full disk it would be in everybody's way.
            fail("can't write an upload");
        }
        size_ += written < 0 ? 0 : written;
        bytes.remove_prefix(written < 0 ? 0 : static_cast<std::size_t>(written));
    }
}

ArtifactId PartialUpload::finish() {
    if (::fsync(file_) != 0) {
        is_kept_ = false;
        fail("can't sync an upload");
    }
    return {hash_.finish(), size_};
}

fs::path PartialUpload::release() {
    return std::exchange(path_, {});
}

void PartialUpload::discard() {
    is_kept_ = false;
}

std::optional<PartialUpload> PartialUploads::open(const std::string& tenant,
                                                  const ArtifactId& artifact, std::int64_t offset) {
    const fs::path directory = directory_of(tenant);
    std::error_code error;
    fs::create_directories(directory, error);
    const fs::path path = directory / artifact.sha256;
    const int file = open_locked(path);
    if (file < 0) {
        if (offset != 0) {
            return std::nullopt;
        }
        const fs::path other = directory / (std::string(kUnkeptPrefix) + random_hex(16));
        PartialUpload upload(other, open_locked(other), false);
        upload.announced_ = announce(tenant, artifact.size);
        return upload;
    }
    PartialUpload upload(path, file, true);
    if (offset == 0) {
        if (::ftruncate(file, 0) != 0) {
            fail("can't begin an upload anew");
        }
    } else if (size_of(file) != offset) {
        upload.size_ = size_of(file);  // What is there stays.
        return std::nullopt;
    } else {
        upload.take_up();
    }
    upload.announced_ = announce(tenant, artifact.size);
    return upload;
}

std::shared_ptr<void> PartialUploads::announce(const std::string& tenant, std::int64_t bytes) {
    const std::scoped_lock lock(mutex_);
    announced_[tenant] += bytes;
    return {nullptr, [this, tenant, bytes](void*) {
                const std::scoped_lock lock_again(mutex_);
                announced_[tenant] -= bytes;
            }};
}

std::int64_t PartialUploads::bytes_of(const std::string& tenant) const {
    std::int64_t bytes = 0;
    std::error_code error;
    for (const auto& file : fs::directory_iterator(directory_of(tenant), error)) {
        bytes += committed(tenant, file.path().filename().string());
    }
    const std::scoped_lock lock(mutex_);
    const auto found = announced_.find(tenant);
    return found == announced_.end() ? bytes : bytes + found->second;
}

int PartialUploads::count(const std::string& tenant) const {
    std::error_code error;
    const fs::directory_iterator files(directory_of(tenant), error);
    return error ? 0 : static_cast<int>(std::distance(begin(files), end(files)));
}

std::int64_t PartialUploads::committed(const std::string& tenant, const std::string& sha256) const {
    const fs::path path = directory_of(tenant) / sha256;
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (file < 0) {
        return 0;
    }
    const bool is_free = ::flock(file, LOCK_SH | LOCK_NB) == 0;
    const std::int64_t size = is_free ? size_of(file) : 0;
    ::close(file);
    return size;
}

void PartialUploads::remove_abandoned(Time before) const {
    std::error_code error;
    for (const auto& tenant : fs::directory_iterator(data_dir_ / "tenants", error)) {
        for (const auto& file : fs::directory_iterator(tenant.path() / "uploads", error)) {
            struct stat status {};
            if (::lstat(file.path().c_str(), &status) != 0) {
                continue;
            }
            const auto touched = Time(std::chrono::seconds(status.st_mtim.tv_sec));
            const int handle = ::open(file.path().c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
            if (handle < 0) {
                continue;
            }
            const bool is_kept = file.path().filename().string().rfind(kUnkeptPrefix, 0) != 0;
            if ((touched < before || !is_kept) && ::flock(handle, LOCK_EX | LOCK_NB) == 0) {
                ::unlink(file.path().c_str());
            }
            ::close(handle);
        }
    }
}

fs::path PartialUploads::directory_of(const std::string& tenant) const {
    return data_dir_ / "tenants" / tenant / "uploads";
}

}  // namespace remesh
