#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <httplib.h>
#include <mutex>
#include <thread>
#include <vector>

namespace remesh::http {

/// Threads for connections, made when they are needed: an event stream holds its thread for as long
/// as somebody watches. Beyond the bound, connections wait.
class TaskQueue final : public httplib::TaskQueue {
public:
    explicit TaskQueue(std::size_t max_threads) : max_threads_(max_threads) {}

    void enqueue(std::function<void()> task) override;
    void shutdown() override;

private:
    void run();

    const std::size_t max_threads_;
    std::mutex mutex_;
    std::condition_variable ready_;
    std::deque<std::function<void()>> tasks_;  // needs mutex_
    std::size_t idle_ = 0;                     // needs mutex_
    bool is_closing_ = false;                  // needs mutex_
    std::vector<std::thread> threads_;         // needs mutex_ until closing
};

}  // namespace remesh::http
