#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
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
    std::int64_t max_queued = 1'000;  ///< More are refused.
    int max_attempts = 3;             ///< A job that lost this many workers is quarantined.
    std::chrono::milliseconds max_run_time = std::chrono::hours(24);  ///< Longest timeout of a job.
    std::chrono::milliseconds flush_interval{100};  ///< How long events wait for company.
};

/// A job as it is shown.
struct JobView {
    JobRecord job{};
    Progress progress{};
    std::int64_t queue_position = 0;
};

class JobRegistry;

/// What registry and worker share about one attempt.
struct Attempt {
    enum class StopReason { None, Cancel, Timeout, Drain };

    JobRecord job{};  ///< As claimed.
    std::stop_source stop{};
    std::mutex flush_mutex{};  ///< Held while events go to the store, so that they stay in order.

    // need JobRegistry::mutex_
    StopReason stop_reason = StopReason::None;
    std::chrono::steady_clock::time_point deadline{};
    std::vector<NewEvent> pending{};  ///< Not yet in the store.
    Progress progress{};
    bool is_abandoned = false;  ///< The store refused the verdict: count it as lost once it can.
};

/// One attempt at a job: a worker's right to run it. Without a verdict by its end the attempt
/// counts as lost, so a worker that throws or returns early can't leave a job Running for ever.
/// For the worker's thread only.
class Lease {
public:
    Lease(JobRegistry& registry, std::shared_ptr<Attempt> attempt);
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    ~Lease();

    [[nodiscard]] const JobRecord& job() const { return attempt_->job; }
    [[nodiscard]] std::stop_token stop_token() const { return attempt_->stop.get_token(); }

    /// Tells the watchers, soon: events are written in company.
    void publish(const JobEventBody& event);
    /// Makes a preview visible at once; the oldest of this attempt go.
    void publish_preview(ArtifactDraft draft, int iteration);

    // The verdicts, each of them final. They return the state that the job came to, or nothing if
    // the lease was void.

    std::optional<JobState> succeed(const JobResult& result, std::vector<ArtifactDraft> outputs);
    std::optional<JobState> fail(const JobFailure& failure,
                                 std::vector<ArtifactDraft> outputs = {});
    /// The run stopped because it was asked to: cancelled, timed out or given back.
    std::optional<JobState> stopped(Stage stage);

private:
    JobRegistry& registry_;
    std::shared_ptr<Attempt> attempt_;
    std::deque<std::string> previews_;  // visible ones, oldest first
    bool is_settled_ = false;
};

/// The only code that changes a job's state (job_store.h draws the machine). Hands out values,
/// never references. All calls may come from any thread.
class JobRegistry {
public:
    using Clock = std::function<Time()>;
    using Listener = std::function<void(const JobKey&)>;

    /// Takes up what the last server left: running jobs count as lost, cancelling ones as
    /// cancelled.
    JobRegistry(JobStore& store, ArtifactStore& artifacts, const JobCodec& codec,
                const Engine& engine, const RegistryOptions& options, Clock clock = {});
    JobRegistry(const JobRegistry&) = delete;
    JobRegistry& operator=(const JobRegistry&) = delete;
    ~JobRegistry();

    /// Called after every change of a job that a watcher can see, by any thread, with no lock held.
    /// Must not block or call back. To be set before anything runs.
    void set_listener(Listener listener);

    struct Submission {
        std::string tenant{};
        std::string request_id{};
        std::string spec{};
        bool validate_only = false;
    };
    /// \throws JobError{BadRequest, MissingInput, RequestIdReused, LimitPassed, ShuttingDown}
    JobView submit(const Submission& submission);
    /// \throws JobError{NotFound}
    JobView get(const JobKey& key);
    std::vector<JobView> list(const ListQuery& query);
    std::vector<StoredEvent> events_after(const JobKey& key, std::int64_t sequence,
                                          std::size_t limit);
    /// \throws JobError{NotFound}
    JobView cancel(const JobKey& key);
    /// \throws JobError{NotFound, NotTerminal, Changed}
    void remove(const JobKey& key, std::optional<std::int64_t> revision);

    /// Waits for a job to run. \return null when asked to stop or shutting down
    std::unique_ptr<Lease> claim(std::stop_token stop);

    /// Waits some seconds. \return false if it was cut short by a stop or by draining
    bool pause(std::stop_token stop);

    /// Refuses new jobs and asks the running ones to stop; they go back to the queue without
    /// spending their attempt.
    void drain();
    [[nodiscard]] bool is_draining() const;
    /// \return whether nothing runs any more
    bool wait_until_idle(std::chrono::milliseconds timeout);
    /// Gives back what still runs although it was asked to stop; its workers can't write any more.
    void surrender();

    [[nodiscard]] const RegistryOptions& options() const { return options_; }

private:
    friend class Lease;

    using Verdict = std::function<std::optional<JobRecord>(const Claim&)>;

    void take_up();
    void tend(std::stop_token stop);
    void abandon_late_attempts();
    /// Writes the attempt's pending events and then `previews`.
    void flush(Attempt& attempt, const std::vector<NewEvent>& more,
               const std::vector<ArtifactId>& previews);
    /// Ends an attempt by a verdict of the store, whose job it returns.
    std::optional<JobRecord> end(Attempt& attempt, const Verdict& verdict);
    std::optional<JobRecord> lose(Attempt& attempt);
    void drop_previews(const JobKey& key, std::span<const std::string> keep);
    void notify(const JobKey& key) const;
    void wake_workers();
    [[nodiscard]] JobView view_of(JobRecord job);
    [[nodiscard]] std::string lost_outcome(const JobRecord& job) const;

    JobStore& store_;
    ArtifactStore& artifacts_;
    const JobCodec& codec_;
    const Engine& engine_;
    const RegistryOptions options_;
    const Clock clock_;
    Listener listener_;

    // Held while a job is claimed, so that a cancel can't fall between the store's claim and
    // running_. Taken before mutex_.
    std::mutex claim_mutex_;
    mutable std::mutex mutex_;
    std::condition_variable_any work_;                    // work_signals_ or is_draining_ changed
    std::condition_variable_any attempts_;                // running_ changed
    std::map<JobKey, std::shared_ptr<Attempt>> running_;  // needs mutex_
    std::uint64_t work_signals_ = 0;                      // needs mutex_
    bool is_draining_ = false;                            // needs mutex_

    std::jthread tender_;
};

}  // namespace remesh
