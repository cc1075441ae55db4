#pragma once

#include <sys/types.h>

#include <chrono>
#include <condition_variable>
#include <csignal>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace remesh {

struct SupervisorOptions {
    int workers = 1;                     ///< Processes, each with one job at a time, >= 1.
    std::vector<std::string> command{};  ///< Program and arguments; gets `--worker-id ID` added.
    std::chrono::milliseconds longest_wait{10'000};  ///< Between two starts of a crashing worker.
};

enum class WorkerEnd {
    Stopped,  ///< As it should.
    Crashed,
    Killed,  ///< By the supervisor, since it didn't stop.
};

/// Keeps worker processes running: starts them, and starts anew those that end.
class Supervisor {
public:
    /// A worker process is gone.
    using OnEnd = std::function<void(const std::string& worker, WorkerEnd end)>;

    Supervisor(const SupervisorOptions& options, OnEnd on_end);
    Supervisor(const Supervisor&) = delete;
    Supervisor& operator=(const Supervisor&) = delete;
    ~Supervisor();

    /// Asks all workers to end (SIGTERM), starts no more.
    void drain();
    /// \return whether all have ended
    bool wait_until_ended(std::chrono::milliseconds timeout);
    /// Ends what didn't (SIGKILL).
    void kill_all();

private:
    struct Slot {
        std::string worker{};
        pid_t process = 0;  ///< 0: none.
        bool is_killed = false;
        std::jthread thread{};
    };

    void keep_running(Slot& slot);
    void reap(Slot& slot, const siginfo_t& end);
    [[nodiscard]] pid_t start(const std::string& worker) const;

    const SupervisorOptions options_;
    const OnEnd on_end_;
    std::mutex mutex_;
    std::condition_variable changed_;           // is_draining_ or a slot's process changed
    bool is_draining_ = false;                  // needs mutex_
    std::vector<std::unique_ptr<Slot>> slots_;  // their contents need mutex_
};

}  // namespace remesh
