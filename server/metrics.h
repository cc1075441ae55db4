#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>

#include "server/jobs/registry.h"

namespace remesh {

struct MetricsOptions {
    std::filesystem::path data_dir{};         ///< Whose disk is watched.
    std::filesystem::path certificate{};      ///< Whose end is told; empty: none.
    std::chrono::milliseconds interval{500};  ///< How long changes of jobs wait for company.
};

/// What Prometheus is told. Names and units are listed in docs/operations.md; labels are stages,
/// states and reasons, never ids.
///
/// Counts what it reads in the jobs' events, as any watcher would, on a thread of its own.
class Metrics {
public:
    Metrics(JobRegistry& registry, JobStore& store, const MetricsOptions& options);
    Metrics(const Metrics&) = delete;
    Metrics& operator=(const Metrics&) = delete;
    ~Metrics();

    /// Something changed about a job. Never blocks.
    void notify(const JobKey& key);
    /// An HTTP request was answered.
    void count_response(int http_status);
    /// All of it in Prometheus' text format, version 0.0.4.
    [[nodiscard]] std::string text();
    /// Waits until everything that happened before this call is counted.
    void settle();

private:
    struct Families;

    /// Where the reading of a job's events stands.
    struct Cursor {
        std::int64_t sequence = 0;
        int attempt = 0;
        std::optional<Stage> stage{};
        Time stage_start{};
        Time start{};
    };

    void run(const std::stop_token& stop);
    void read(const JobKey& key);
    void count_state(const JobView& job, const StoredEvent& event, Cursor& cursor);
    void leave_stage(Time time, Cursor& cursor);
    void update_gauges();

    JobRegistry& registry_;
    JobStore& store_;
    const MetricsOptions options_;
    const Time start_;
    std::unique_ptr<Families> families_;
    std::map<JobKey, Cursor> cursors_;  // the thread's own

    std::mutex mutex_;
    std::condition_variable_any changed_;
    std::set<JobKey> pending_;  // needs mutex_
    bool is_reading_ = false;   // needs mutex_
    std::jthread thread_;
};

}  // namespace remesh
