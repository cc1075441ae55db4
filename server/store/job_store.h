#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "server/store/job_record.h"

namespace remesh {

/// Tells one listener which jobs got new events, whoever wrote them, in this process or another.
/// For one thread.
class ChangeFeed {
public:
    ChangeFeed() = default;
    ChangeFeed(const ChangeFeed&) = delete;
    ChangeFeed& operator=(const ChangeFeed&) = delete;
    virtual ~ChangeFeed() = default;

    /// Waits for changes after those that were told before, at most `timeout` or until asked to
    /// stop. A job that is gone again isn't told.
    virtual std::vector<JobKey> next(std::chrono::milliseconds timeout,
                                     const std::stop_token& stop) = 0;
};

/// What outlives the process: jobs, their events, and which artifacts exist and who needs them.
/// Any number of processes may use one store at a time.
///
/// The job machine; every arrow is one atomic, durable step that appends one State event:
///
///     Queued --claim--> Running --settle--> Succeeded | Failed
///       |                  |  '--give_back--> Queued          (the attempt isn't spent)
///       |                  |  '--lose-------> Queued until its retry time, or Quarantined or
///       |                  |                  Failed after max_crashes or max_attempts
///       |            request_cancel
///       |                  v
///       |              Cancelling --settle, give_back, lose--> Cancelled
///       '--request_cancel--> Cancelled
///
/// What a worker writes is fenced: with an old epoch nothing changes and the answer is "no".
/// Clocks may jump: a job's times never go backwards, and no step depends on what they say but for
/// the wait of a retry, which a jump can't make longer than kLongestRetry.
/// All calls may come from any thread. All throw StoreError if the store can't do its work.
class JobStore {
public:
    JobStore() = default;
    JobStore(const JobStore&) = delete;
    JobStore& operator=(const JobStore&) = delete;
    virtual ~JobStore() = default;

    /// A retry time further away than this comes from a clock that jumped, and is over.
    static constexpr std::chrono::minutes kLongestRetry{10};

    /// Adds a job, unless its request id is known, a limit is reached or an input is missing. If
    /// it may reuse a result and one of its tenant and cache key is there, the job gets that.
    virtual Creation create(const NewJob& job, const QueueLimits& limits, Time now) = 0;
    virtual std::optional<JobRecord> find(const JobKey& key) = 0;
    /// Digests of the outputs that a job of this cache key would get now, each once; none if there
    /// is no such result.
    virtual std::vector<std::string> reusable_outputs(const std::string& tenant,
                                                      const std::string& cache_key) = 0;
    /// Newest first.
    virtual std::vector<JobRecord> list(const ListQuery& query) = 0;
    /// How many of its tenant's jobs will be claimed before this one; 0 unless it is Queued. What
    /// other tenants wait for is nobody else's business.
    virtual std::int64_t queue_position(const JobRecord& job) = 0;
    /// Events after a sequence, in order, at most `limit`.
    virtual std::vector<StoredEvent> events_after(const JobKey& key, std::int64_t sequence,
                                                  std::size_t limit) = 0;
    /// Payload of the newest Progress event of the present attempt, or empty.
    virtual std::string last_progress(const JobKey& key) = 0;
    /// Follows the store's changes from now on.
    virtual std::unique_ptr<ChangeFeed> follow() = 0;

    /// Takes a queued job: of the tenant that has used the smallest share of the workers, the
    /// one of highest priority, the oldest first.
    virtual std::optional<JobRecord> claim(const ClaimRequest& request, Time now) = 0;
    /// Shows that a worker is alive. \return the job's state, or nothing if the claim is void
    virtual std::optional<JobState> renew(const Claim& claim) = 0;
    /// Adds events of a running attempt, and the previews that they name.
    /// \return the job's last sequence, or nothing if the claim is void
    virtual std::optional<std::int64_t> append(const Claim& claim, std::span<const NewEvent> events,
                                               std::span<const ArtifactId> previews, Time now) = 0;
    /// Ends an attempt for good. A Cancelling job becomes Cancelled whatever was handed in.
    virtual std::optional<JobRecord> settle(const Claim& claim, const Settlement& settlement,
                                            Time now) = 0;
    /// Ends an attempt as if it hadn't been.
    virtual std::optional<JobRecord> give_back(const Claim& claim, Time now) = 0;
    /// Ends an attempt that failed for no reason of its own, or whose worker is gone.
    virtual std::optional<JobRecord> lose(const Claim& claim, const Loss& loss, Time now) = 0;
    /// Every Running or Cancelling job.
    virtual std::vector<JobRecord> held() = 0;

    /// Cancels a queued job, asks a running one to stop, leaves a terminal one as it is.
    virtual std::optional<JobRecord> request_cancel(const JobKey& key, Time now) = 0;

    enum class Removal { Removed, NotFound, NotTerminal, OtherRevision };
    /// Deletes a terminal job and its events. Its artifacts stay until `remove_artifact`.
    /// \param revision  if given, the job must still have it
    /// \param artifacts  gets the digests that the job referred to
    virtual Removal remove(const JobKey& key, std::optional<std::int64_t> revision,
                           std::vector<std::string>* artifacts) = 0;
    /// Jobs that became terminal before a time, the oldest first, at most `limit`.
    virtual std::vector<JobKey> ended_before(Time time, std::size_t limit) = 0;
    /// Jobs of a tenant, or of all, that became terminal at a time or later, the newest first, at
    /// most `limit`.
    virtual std::vector<JobKey> ended_since(const std::optional<std::string>& tenant, Time time,
                                            std::size_t limit) = 0;
    /// Mean time from claim to success of the tenant's newest `count` such jobs that were really
    /// run, or nothing if there is none.
    virtual std::optional<std::chrono::microseconds> mean_run_time(const std::string& tenant,
                                                                   std::size_t count) = 0;

    /// Records that an artifact is there. Does nothing if it was known.
    /// \return false if the tenant may keep no more bytes: its policy's, or else `max_bytes`
    virtual bool add_artifact(const std::string& tenant, const ArtifactId& artifact,
                              std::optional<std::int64_t> max_bytes, Time now) = 0;
    virtual std::optional<ArtifactId> find_artifact(const std::string& tenant,
                                                    const std::string& sha256) = 0;
    /// Takes the previews of unfinished attempts off the job, all but those in `keep`.
    /// \return the digests that it no longer refers to
    virtual std::vector<std::string> drop_previews(const JobKey& key,
                                                   std::span<const std::string> keep) = 0;
    /// Forgets an artifact unless a job refers to it. \return whether it is forgotten
    virtual bool remove_artifact(const std::string& tenant, const std::string& sha256) = 0;
    /// Artifacts that no job refers to and that were added before `before`: tenant and digest.
    virtual std::vector<JobKey> unreferenced_artifacts(Time before) = 0;

    /// Counts for monitoring.
    virtual StoreFigures figures() = 0;
    /// Tenants with a job that isn't terminal, by name.
    virtual std::vector<TenantBacklog> backlogs() = 0;

    /// Sum of the sizes of a tenant's artifacts.
    virtual std::int64_t stored_bytes(const std::string& tenant) = 0;

    virtual void set_policy(const std::string& tenant, const TenantPolicy& policy) = 0;
    /// The defaults if none was set.
    virtual TenantPolicy policy(const std::string& tenant) = 0;
};

}  // namespace remesh
