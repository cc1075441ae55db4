#include "client/pending_file.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <string>
#include <unistd.h>
#include <utility>

#include "client/failure.h"

namespace remesh::client {
namespace {

namespace fs = std::filesystem;

Failure cannot_write(const fs::path& path) {
    return system_failure(fmt::format("can't write {}", path.string()));
}

/// The mode that a file made by open(2) would get; mkostemp makes 0600.
mode_t usual_mode() {
    const mode_t mask = umask(0);
    umask(mask);
    return static_cast<mode_t>(0666U & ~mask);
}

}  // namespace

PendingFile::PendingFile(const fs::path& target) : target_(target) {
    std::error_code ignored;
    if (target != "-") {
        const fs::path resolved = fs::weakly_canonical(target, ignored);
        target_ = resolved.empty() ? target : resolved;
    }
    if (target == "-" || (fs::exists(target_, ignored) && !fs::is_regular_file(target_, ignored))) {
        fd_ = open_unnamed_file();
        return;
    }
    std::string name =
        (target_.parent_path() / ("." + target_.filename().string() + ".XXXXXX")).string();
    fd_.reset(mkostemp(name.data(), O_CLOEXEC));
    if (!fd_.is_open()) {
        throw cannot_write(target);
    }
    temporary_ = name;
}

PendingFile::PendingFile(PendingFile&& other) noexcept
    : target_(std::move(other.target_)),
      temporary_(std::exchange(other.temporary_, {})),
      fd_(std::move(other.fd_)) {}

PendingFile::~PendingFile() {
    if (!temporary_.empty()) {
        unlink(temporary_.c_str());
    }
}

void PendingFile::write(std::span<const char> bytes) {
    write_fully(fd_.get(), bytes, target_);
}

void PendingFile::commit() {
    if (temporary_.empty()) {
        pour();
        return;
    }
    if (fchmod(fd_.get(), usual_mode()) != 0 || fsync(fd_.get()) != 0 ||
        rename(temporary_.c_str(), target_.c_str()) != 0) {
        throw cannot_write(target_);
    }
    temporary_.clear();
    const UniqueFd folder(open(target_.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    fsync(folder.get());  // Best effort: the bytes are safe, only the name might be lost.
}

void PendingFile::pour() const {
    const UniqueFd to(target_ == "-" ? dup(STDOUT_FILENO)
                                     : open(target_.c_str(), O_WRONLY | O_CLOEXEC));
    if (!to.is_open()) {
        throw cannot_write(target_);
    }
    std::array<char, 64 * 1024> buffer{};
    lseek(fd_.get(), 0, SEEK_SET);
    for (ssize_t got = 0; (got = read(fd_.get(), buffer.data(), buffer.size())) > 0;) {
        write_fully(to.get(), {buffer.data(), static_cast<std::size_t>(got)}, target_);
    }
}

UniqueFd open_unnamed_file() {
    std::string name = (fs::temp_directory_path() / "remesh-XXXXXX").string();
    UniqueFd fd(mkostemp(name.data(), O_CLOEXEC));
    if (!fd.is_open()) {
        throw system_failure("can't make a temporary file");
    }
    unlink(name.c_str());
    return fd;
}

void write_fully(int fd, std::span<const char> bytes, const fs::path& what) {
    while (!bytes.empty()) {
        const ssize_t written = write(fd, bytes.data(), bytes.size());
        if (written > 0) {
            bytes = bytes.subspan(static_cast<std::size_t>(written));
        } else if (written < 0 && errno != EINTR) {
            throw cannot_write(what == "-" ? fs::path("stdout") : what);
        }
    }
}

}  // namespace remesh::client
