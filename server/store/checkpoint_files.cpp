#include "server/store/checkpoint_files.h"

#include <cerrno>
#include <fcntl.h>
#include <fstream>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "server/store/digest.h"
#include "server/store/file_failure.h"
#include "server/store/job_store.h"

namespace remesh {
namespace {

namespace fs = std::filesystem;

// Of the format of the file; the engine's version is in the key.
constexpr std::string_view kMagic = "remesh checkpoint 1\n";
constexpr std::size_t kHexDigits = 64;

std::string digest_of(const std::vector<std::string_view>& pieces) {
    Sha256 hash;
    for (const std::string_view piece : pieces) {
        hash.add(piece);
    }
    return hash.finish();
}

/// A file that is deleted unless it gets its name.
class PartFile {
public:
    explicit PartFile(fs::path path) : path_(std::move(path)) {
        file_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        if (file_ < 0) {
            fail("can't create a checkpoint");
        }
    }
    PartFile(const PartFile&) = delete;
    PartFile& operator=(const PartFile&) = delete;
    ~PartFile() {
        ::close(file_);
        if (!path_.empty()) {
            ::unlink(path_.c_str());
        }
    }

    void write(std::string_view bytes) {
        while (!bytes.empty()) {
            const ssize_t written = ::write(file_, bytes.data(), bytes.size());
            if (written < 0 && errno != EINTR) {
                fail("can't write a checkpoint");
            }
            bytes.remove_prefix(written < 0 ? 0 : static_cast<std::size_t>(written));
        }
    }
    void rename_to(const fs::path& path) {
        if (::fsync(file_) != 0 || ::rename(path_.c_str(), path.c_str()) != 0) {
            fail("can't put a checkpoint in its place");
        }
        path_.clear();
    }

private:
    fs::path path_;
    int file_ = -1;
};

}  // namespace

CheckpointFiles::CheckpointFiles(fs::path data_dir) : data_dir_(std::move(data_dir)) {}

void CheckpointFiles::save(const JobKey& job, std::string_view key,
                           const std::vector<std::string_view>& pieces) const {
    const fs::path directory = directory_of(job.tenant);
    std::error_code error;
    fs::create_directories(directory, error);
    if (error) {
        errno = error.value();
        fail("can't make the directory of checkpoints");
    }
    // A worker that has lost its lease may still be writing one.
    PartFile file(directory / (job.id + "." + std::to_string(::getpid())));
    file.write(kMagic);
    file.write(std::string(key) + '\n' + digest_of(pieces) + '\n');
    for (const std::string_view piece : pieces) {
        file.write(piece);
    }
    file.rename_to(directory / job.id);
}

CheckpointFiles::Loaded CheckpointFiles::load(const JobKey& job, std::string_view key) const {
    const fs::path path = directory_of(job.tenant) / job.id;
    std::ifstream file(path, std::ios::binary);
    if (!file) {
        return {};
    }
    const std::string start = std::string(kMagic) + std::string(key) + '\n';
    std::string header(start.size() + kHexDigits + 1, '\0');
    if (!file.read(header.data(), static_cast<std::streamsize>(header.size()))) {
        return {.finding = Finding::Damaged};
    }
    if (!header.starts_with(start)) {
        return {.finding = Finding::Stale};
    }
    std::string state(fs::file_size(path) - header.size(), '\0');
    const bool is_read = !!file.read(state.data(), static_cast<std::streamsize>(state.size()));
    if (!is_read || header.compare(start.size(), kHexDigits, sha256_of(state)) != 0) {
        return {.finding = Finding::Damaged};
    }
    return {.finding = Finding::Good, .state = std::move(state)};
}

void CheckpointFiles::remove(const JobKey& job) const {
    std::error_code none;
    fs::remove(directory_of(job.tenant) / job.id, none);
}

void CheckpointFiles::collect_garbage(const std::function<bool(const JobKey&)>& is_needed) const {
    std::error_code none;
    for (const auto& tenant : fs::directory_iterator(data_dir_ / "tenants", none)) {
        for (const auto& file : fs::directory_iterator(tenant.path() / "checkpoints", none)) {
            const std::string name = file.path().filename().string();
            if (!is_needed({tenant.path().filename().string(), name.substr(0, name.find('.'))})) {
                fs::remove(file.path(), none);
            }
        }
    }
}

fs::path CheckpointFiles::directory_of(const std::string& tenant) const {
    return data_dir_ / "tenants" / tenant / "checkpoints";
}

}  // namespace remesh
