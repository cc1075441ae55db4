#include "server/store/worker_roster.h"

#include <sys/file.h>

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string_view>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "server/store/job_record.h"

namespace remesh {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kUnborn = ".new";

bool is_locked(const fs::path& file) {
    const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        return errno != ENOENT;  // in doubt it lives: its beat will tell
    }
    const bool is_held = ::flock(fd, LOCK_SH | LOCK_NB) != 0;
    ::close(fd);
    return is_held;
}

}  // namespace

WorkerRoster::WorkerRoster(const fs::path& data_dir) : directory_(data_dir / "workers") {
    std::error_code error;
    fs::create_directories(directory_, error);
    if (error) {
        throw StoreError("store: can't make " + directory_.string() + ": " + error.message());
    }
}

bool WorkerRoster::is_alive(const std::string& worker) const {
    return is_locked(directory_ / worker);
}

std::vector<std::string> WorkerRoster::alive() const {
    std::vector<std::string> workers;
    for (const auto& file : fs::directory_iterator(directory_)) {
        const std::string name = file.path().filename().string();
        if (!name.ends_with(kUnborn) && is_locked(file.path())) {
            workers.push_back(name);
        }
    }
    return workers;
}

void WorkerRoster::tidy() const {
    for (const auto& file : fs::directory_iterator(directory_)) {
        if (!file.path().filename().string().ends_with(kUnborn) && !is_locked(file.path())) {
            ::unlink(file.path().c_str());
        }
    }
}

// Locked before it has its name, so that nobody takes it for a dead one's.
WorkerEntry::WorkerEntry(const WorkerRoster& roster, std::string worker)
    : worker_(std::move(worker)), file_(roster.directory_ / worker_) {
    fs::path unborn = file_;
    unborn += kUnborn;
    lock_ = ::open(unborn.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (lock_ < 0 || ::flock(lock_, LOCK_EX | LOCK_NB) != 0 ||
        ::rename(unborn.c_str(), file_.c_str()) != 0) {
        throw StoreError("store: can't enter worker " + worker_ +
                         " in the roster: " + std::strerror(errno));
    }
}

WorkerEntry::~WorkerEntry() {
    ::unlink(file_.c_str());
    ::close(lock_);
}

}  // namespace remesh
