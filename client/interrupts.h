#pragma once

#include <stop_token>
#include <thread>

#include "client/unique_fd.h"

namespace remesh::client {

/// Turns SIGINT, SIGTERM and SIGHUP into stop tokens.
///
/// Make one at the start of main, before any thread: it blocks the signals in the caller, whose
/// threads inherit that, and one thread of its own receives them. Code that waits takes a token
/// and needs to know nothing about signals.
class Interrupts {
public:
    Interrupts();
    ~Interrupts();
    Interrupts(const Interrupts&) = delete;
    Interrupts& operator=(const Interrupts&) = delete;

    [[nodiscard]] std::stop_token first() const { return first_.get_token(); }
    [[nodiscard]] std::stop_token second() const { return second_.get_token(); }

private:
    void listen();

    std::stop_source first_;
    std::stop_source second_;
    UniqueFd signal_fd_;
    UniqueFd leave_fd_;
    std::thread listener_;
};

}  // namespace remesh::client
