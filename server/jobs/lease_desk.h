#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
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
#include "server/jobs/job.h"
#include "server/store/artifact_store.h"
#include "server/store/job_store.h"

namespace remesh {

struct DeskOptions {
    std::string worker{};  ///< This process, as the store and the roster know it; not empty.
    std::optional<std::int64_t> max_running_of_tenant{};
    std::chrono::milliseconds max_run_time = std::chrono::hours(24);  ///< Longest timeout of a job.
    /// Most memory that this process may hold while a job runs; for processes with one worker.
    std::optional<std::int64_t> max_process_bytes{};
    std::chrono::milliseconds flush_interval{100};  ///< How long events wait for company.
    std::chrono::milliseconds beat_interval{10'000};
    /// A run that was asked to stop and goes on for longer is settled without it.
    std::chrono::milliseconds stop_grace{60'000};
    /// Called after that: its worker is lost to others until the process ends.
    std::function<void()> on_stuck{};
};

class LeaseDesk;

/// What desk and worker share about one attempt.
struct Attempt {
    enum class StopReason { None, Cancel, Timeout, Memory, Drain, Void };

    JobRecord job{};  ///< As claimed.
    std::stop_source stop{};
    std::mutex flush_mutex{};  ///< Held while events go to the store, so that they stay in order.

    // need LeaseDesk::mutex_
    StopReason stop_reason = StopReason::None;
    std::optional<std::chrono::steady_clock::time_point> stop_time{};  ///< When it was asked to.
    Stage stage = Stage::Read;
    std::chrono::steady_clock::time_point deadline{};
    std::chrono::steady_clock::time_point next_beat{};
    std::vector<NewEvent> pending{};  ///< Not yet in the store.
    bool is_abandoned = false;  ///< The store refused the verdict: count it as lost once it can.
};

/// One attempt at a job: a worker's right to run it. Without a verdict by its end the attempt
/// counts as lost, so a worker that throws or returns early can't leave a job Running for ever.
/// For the worker's thread only.
class Lease {
public:
    Lease(LeaseDesk& desk, std::shared_ptr<Attempt> attempt);
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    ~Lease();

    [[nodiscard]] const JobRecord& job() const { return attempt_->job; }
    [[nodiscard]] std::stop_token stop_token() const { return attempt_->stop.get_token(); }
    /// Whether it was asked to stop so that another attempt can go on.
    [[nodiscard]] bool is_giving_back() const;

    /// Tells the watchers, soon: events are written in company.
    void publish(const JobEventBody& event);
    /// Makes a preview visible at once; the oldest of this attempt go.
    void publish_preview(ArtifactDraft draft, int iteration);

    // The verdicts, each of them final. They return the state that the job came to, or nothing if
    // the lease was void.

    std::optional<JobState> succeed(const JobResult& result, std::vector<ArtifactDraft> outputs);
    std::optional<JobState> fail(const JobFailure& failure,
                                 std::vector<ArtifactDraft> outputs = {});
    /// The run stopped because it was asked to: cancelled, timed out, too large or given back.
    std::optional<JobState> stopped(Stage stage);
    /// The store didn't give or take the job's files: it is tried again later.
    std::optional<JobState> postpone();

private:
    friend class LeaseDesk;

    using Verdict = std::function<std::optional<JobRecord>(const Claim&)>;

    std::optional<JobState> settle(const Verdict& verdict);
    std::optional<JobState> settle(const Settlement& settlement,
                                   std::vector<ArtifactDraft> outputs);

    LeaseDesk& desk_;
    std::shared_ptr<Attempt> attempt_;
    std::deque<std::string> previews_;  // visible ones, oldest first
    bool is_settled_ = false;
};

/// Hands out leases to the workers of this process, keeps them alive, writes what their runs tell,
/// and carries out what the store or the limits say: cancel, time out, give back.
/// All calls may come from any thread.
class LeaseDesk {
public:
    using Clock = std::function<Time()>;

    LeaseDesk(JobStore& store, ArtifactStore& artifacts, const JobCodec& codec,
              const DeskOptions& options, Clock clock = {});
    LeaseDesk(const LeaseDesk&) = delete;
    LeaseDesk& operator=(const LeaseDesk&) = delete;
    ~LeaseDesk();

    /// Waits for a job to run. \return null when asked to stop or shutting down
    std::unique_ptr<Lease> claim(const std::stop_token& stop);
    /// Waits some seconds. \return false if it was cut short by a stop or by draining
    bool pause(const std::stop_token& stop);

    /// Hands out nothing more and asks what runs to stop; it goes back to the queue without
    /// spending its attempt.
    void drain();
    /// \return whether nothing runs any more
    bool wait_until_idle(std::chrono::milliseconds timeout);
    /// Gives back what still runs although it was asked to stop; its workers can't write any more.
    void surrender();

private:
    friend class Lease;

    using Verdict = Lease::Verdict;
    using Attempts = std::vector<std::shared_ptr<Attempt>>;

    std::unique_ptr<Lease> admit(const JobRecord& job);
    void tend(const std::stop_token& stop);
    void listen(const std::stop_token& stop, ChangeFeed& feed);
    /// Finds what exceeds its limits. \return all attempts
    Attempts look_at_limits();
    void beat(const Attempts& attempts);
    void lose_abandoned();
    /// Settles attempts whose run doesn't stop.
    void end_stuck(const Attempts& attempts);
    bool is_stuck(const Attempt& attempt);
    /// \return whether it was this that ended the attempt
    bool settle_without(Attempt& attempt);
    /// How an attempt ends that stopped for a reason; it is given back if that says nothing.
    [[nodiscard]] std::optional<Settlement> failure_of(Attempt::StopReason reason,
                                                       Stage stage) const;
    /// Makes an attempt stop if the store says that it shall.
    void obey(Attempt& attempt, std::optional<JobState> state);
    void stop_for(Attempt& attempt, Attempt::StopReason reason);  // needs mutex_
    /// Writes the attempt's pending events and then `previews`.
    void flush(Attempt& attempt, const std::vector<NewEvent>& more,
               const std::vector<ArtifactId>& previews);
    /// Ends an attempt by a verdict of the store, whose job it returns.
    std::optional<JobRecord> end(Attempt& attempt, const Verdict& verdict);
    void lose(Attempt& attempt);
    void drop_previews(const JobKey& key, std::span<const std::string> keep);
    [[nodiscard]] std::string memory_limit_passed() const;

    JobStore& store_;
    ArtifactStore& artifacts_;
    const JobCodec& codec_;
    const DeskOptions options_;
    const Clock clock_;

    // Held while a job is claimed, so that a cancel can't fall between the store's claim and
    // running_. Taken before mutex_.
    std::mutex claim_mutex_;
    std::mutex mutex_;
    std::condition_variable_any work_;                    // work_signals_ or is_draining_ changed
    std::condition_variable_any attempts_;                // running_ or leases_ changed
    std::map<JobKey, std::shared_ptr<Attempt>> running_;  // needs mutex_
    int leases_ = 0;  // That live, also of runs that were settled without them. Needs mutex_.
    std::uint64_t work_signals_ = 0;  // needs mutex_
    bool is_draining_ = false;        // needs mutex_

    std::jthread tender_;
    std::jthread listener_;
};

}  // namespace remesh
