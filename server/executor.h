#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace remesh {

/// A few threads for what may wait for a disk, so that gRPC's own threads never do.
class Executor {
public:
    explicit Executor(int threads);
    Executor(const Executor&) = delete;
    Executor& operator=(const Executor&) = delete;
    /// Runs what was posted, then ends.
    ~Executor();

    void post(std::function<void()> task);

private:
    void run();

    std::mutex mutex_;
    std::condition_variable ready_;
    std::deque<std::function<void()>> tasks_;  // needs mutex_
    bool is_closing_ = false;                  // needs mutex_

    std::vector<std::jthread> threads_;
};

}  // namespace remesh
