#include "client/interrupts.h"

#include <sys/eventfd.h>
#include <sys/signalfd.h>

#include <array>
#include <csignal>
#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include "client/failure.h"

namespace remesh::client {

Interrupts::Interrupts() {
    sigset_t signals;
    sigemptyset(&signals);
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
        sigaddset(&signals, number);
    }
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    signal_fd_.reset(signalfd(-1, &signals, SFD_CLOEXEC));
    leave_fd_.reset(eventfd(0, EFD_CLOEXEC));
    if (!signal_fd_.is_open() || !leave_fd_.is_open()) {
        throw system_failure("can't listen for signals");
    }
    listener_ = std::thread([this] { listen(); });
}

Interrupts::~Interrupts() {
    eventfd_write(leave_fd_.get(), 1);
    listener_.join();
}

void Interrupts::listen() {
    std::array<pollfd, 2> sources{pollfd{signal_fd_.get(), POLLIN, 0},
                                  pollfd{leave_fd_.get(), POLLIN, 0}};
    while (true) {
        if (poll(sources.data(), sources.size(), -1) < 0) {
            continue;
        }
        if (sources[1].revents != 0) {
            return;
        }
        signalfd_siginfo info{};
        if (read(signal_fd_.get(), &info, sizeof(info)) == sizeof(info)) {
            (first_.stop_requested() ? second_ : first_).request_stop();
        }
    }
}

}  // namespace remesh::client
