#pragma once

#include <chrono>
#include <filesystem>
#include <stop_token>

namespace remesh {

/// A file that processes on one machine ring after a change, so that others needn't poll. What
/// counts is the change; a ring that gets lost costs the listener's timeout.
class Bell {
public:
    /// Makes the file if it isn't there. \throws StoreError if it can't be
    explicit Bell(std::filesystem::path file);
    Bell(const Bell&) = delete;
    Bell& operator=(const Bell&) = delete;
    ~Bell();

    /// From any thread.
    void ring() const noexcept;
    [[nodiscard]] const std::filesystem::path& file() const { return file_; }

private:
    std::filesystem::path file_;
    int fd_ = -1;
};

/// Hears a bell from the moment of construction on. For one thread.
class BellListener {
public:
    explicit BellListener(const Bell& bell);
    BellListener(const BellListener&) = delete;
    BellListener& operator=(const BellListener&) = delete;
    ~BellListener();

    /// Returns after a ring that wasn't heard before, after `timeout`, or when asked to stop. Where
    /// the system gives no more inotify instances it returns every 50 ms.
    void wait(std::chrono::milliseconds timeout, const std::stop_token& stop);

private:
    int inotify_ = -1;
    int stop_event_ = -1;
};

}  // namespace remesh
