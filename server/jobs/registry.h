#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/jobs/codec.h"
#include "server/jobs/engine.h"
#include "server/jobs/job.h"
#include "server/store/artifact_store.h"
#include "server/store/job_store.h"

namespace remesh {

struct RegistryOptions {
    QueueLimits limits{};  ///< More is refused.
    int max_attempts = 5;  ///< A job that lost this many workers is quarantined.
    int workers = 1;       ///< That serve the queue, for the estimate of a job's start.
    /// What a job of a spec would need with an input; absent: the engine tells, in this process.
    std::function<JobEstimate(std::string_view spec, const JobFiles& inputs)> estimator{};
};

/// A job as it is shown.
struct JobView {
    JobRecord job{};
    Progress progress{};
    std::int64_t queue_position = 0;
    std::optional<Time> estimated_start{};  ///< Of a Queued job, once some job has been run.
    std::optional<JobEstimate> estimate{};  ///< Of a job that was only checked.
};

/// What callers do to jobs. Hands out values, never references. All calls may come from any thread;
/// what changes a job's state is one step of the store, which all processes share.
class JobRegistry {
public:
    using Clock = std::function<Time()>;
    using Listener = std::function<void(const JobKey&)>;

    JobRegistry(JobStore& store, ArtifactStore& artifacts, const JobCodec& codec,
                const Engine& engine, const RegistryOptions& options, Clock clock = {});
    JobRegistry(const JobRegistry&) = delete;
    JobRegistry& operator=(const JobRegistry&) = delete;
    ~JobRegistry();

    /// Called after every change of a job that a watcher can see, whoever made it, with no lock
    /// held. Must not block or call back. To be set once, before anything runs.
    void set_listener(Listener listener);
    /// Waits until the listener has heard of every change that was made before this call.
    void settle();
    /// Ends that: after it returns only `remove` still calls the listener.
    void stop_listening() { thread_ = {}; }

    struct Submission {
        std::string tenant{};
        std::string request_id{};
        std::string spec{};
        bool validate_only = false;
    };
    /// \throws JobError{BadRequest, MissingInput, RequestIdReused, LimitPassed, ShuttingDown}
    JobView submit(const Submission& submission);
    /// Submits a failed, cancelled or quarantined job's spec again, as a new job.
    /// \throws JobError{NotFound, NotRetryable, MissingInput, LimitPassed, ShuttingDown}
    JobView retry(const JobKey& key, const std::string& request_id);
    /// \throws JobError{NotFound}
    JobView get(const JobKey& key);
    std::vector<JobView> list(const ListQuery& query);
    std::vector<StoredEvent> events_after(const JobKey& key, std::int64_t sequence,
                                          std::size_t limit);
    /// \throws JobError{NotFound}
    JobView cancel(const JobKey& key);
    /// \throws JobError{NotFound, NotTerminal, Changed}
    void remove(const JobKey& key, std::optional<std::int64_t> revision);

    /// Refuses new jobs from now on.
    void drain() { is_draining_ = true; }
    [[nodiscard]] bool is_draining() const { return is_draining_; }

    [[nodiscard]] const RegistryOptions& options() const { return options_; }

private:
    void listen(ChangeFeed& feed, const std::stop_token& stop);
    [[nodiscard]] JobView check_only(const Submission& submission, const JobRequest& request);
    /// Whether the files of a result that answers equal jobs are all there, as far as is known.
    [[nodiscard]] bool is_result_whole(const std::string& tenant,
                                       const std::string& cache_key) const;
    [[nodiscard]] JobView create(const NewJob& job);
    [[nodiscard]] JobView view_of(JobRecord job);
    void notify(const JobKey& key) const;

    JobStore& store_;
    ArtifactStore& artifacts_;
    const JobCodec& codec_;
    const Engine& engine_;
    const RegistryOptions options_;
    const Clock clock_;
    std::atomic<bool> is_draining_ = false;
    Listener listener_;
    std::atomic<std::int64_t> asked_ = 0;  // by settle
    std::atomic<std::int64_t> heard_ = 0;
    std::jthread thread_;
};

}  // namespace remesh
