#include "server/store/bell.h"

#include <sys/eventfd.h>
#include <sys/inotify.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <string>
#include <unistd.h>
#include <utility>

#include "server/store/job_record.h"

namespace remesh {
namespace {

constexpr std::chrono::milliseconds kPollInterval{50};

}  // namespace

Bell::Bell(std::filesystem::path file) : file_(std::move(file)) {
    fd_ = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    if (fd_ < 0) {
        throw StoreError("store: can't open " + file_.string() + ": " + std::strerror(errno));
    }
}

Bell::~Bell() {
    ::close(fd_);
}

void Bell::ring() const noexcept {
    // On a full disk this fails, and listeners wait for their timeout.
    [[maybe_unused]] const ssize_t written = ::pwrite(fd_, "!", 1, 0);
}

BellListener::BellListener(const Bell& bell)
    : inotify_(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC)),
      stop_event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (inotify_ >= 0 && ::inotify_add_watch(inotify_, bell.file().c_str(), IN_MODIFY) < 0) {
        ::close(std::exchange(inotify_, -1));
    }
}

BellListener::~BellListener() {
    for (const int fd : {inotify_, stop_event_}) {
        if (fd >= 0) {
            ::close(fd);
        }
    }
}

void BellListener::wait(std::chrono::milliseconds timeout, const std::stop_token& stop) {
    const std::stop_callback wake(stop, [this] {
        const std::uint64_t one = 1;
        [[maybe_unused]] const ssize_t written = ::write(stop_event_, &one, sizeof(one));
    });
    if (inotify_ < 0) {
        timeout = std::min(timeout, kPollInterval);
    }
    // poll ignores negative descriptors.
    std::array<pollfd, 2> events{{{inotify_, POLLIN, 0}, {stop_event_, POLLIN, 0}}};
    if (::poll(events.data(), events.size(), static_cast<int>(timeout.count())) > 0 &&
        (events[0].revents & POLLIN) != 0) {
        std::array<char, 4096> buffer{};
        while (::read(inotify_, buffer.data(), buffer.size()) > 0) {
        }
    }
}

}  // namespace remesh
