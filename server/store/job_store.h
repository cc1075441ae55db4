#pragma once

#include <chrono>
#include <compare>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace remesh {

using Time = std::chrono::sys_time<std::chrono::microseconds>;

[[nodiscard]] inline Time system_now() {
    return std::chrono::time_point_cast<std::chrono::microseconds>(
        std::chrono::system_clock::now());
}

/// The store can't do its work: disk full, damaged, or a data directory that it must not use.
class StoreError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

enum class JobState { Queued, Running, Cancelling, Succeeded, Failed, Cancelled, Quarantined };

[[nodiscard]] constexpr bool is_terminal(JobState state) {
    return state >= JobState::Succeeded;
}

struct JobKey {
    std::string tenant{};
    std::string id{};

    auto operator<=>(const JobKey&) const = default;
};

/// Names bytes by their content.
struct ArtifactId {
    std::string sha256{};  ///< 64 lower-case hexadecimal digits.
    std::int64_t size = 0;

    bool operator==(const ArtifactId&) const = default;
};

struct JobRecord {
    JobKey key{};
    std::int64_t number = 0;  ///< Order of creation, from 1.
    std::string spec{};       ///< What was asked for; the store never looks inside.
    int priority = 0;
    JobState state = JobState::Queued;
    int attempt =
        0;  ///< Present or last one, from 1; an attempt that was given back isn't counted.
    int max_attempts = 1;
    std::int64_t epoch = 0;     ///< Times claimed: only the claim of this epoch may write.
    std::int64_t revision = 0;  ///< Changes whenever the job does.
    Time create_time{};
    std::optional<Time> start_time{};  ///< Of the present or last attempt.
    std::optional<Time> end_time{};    ///< When it became terminal.
    std::string outcome{};             ///< Of a terminal job, empty if it was Cancelled; opaque.
    std::int64_t last_sequence = 0;
};

enum class EventKind { State, Progress, Sample, Warning, Preview };

struct NewEvent {
    EventKind kind = EventKind::Progress;  ///< Not State: the store writes those itself.
    Time time{};
    std::string payload{};  ///< The store never looks inside.
};

struct StoredEvent {
    std::int64_t sequence = 0;  ///< Strictly increasing per job, from 1, without gaps.
    EventKind kind = EventKind::State;
    Time time{};
    std::string payload{};              ///< Empty for State.
    JobState state = JobState::Queued;  ///< Of a State event: what the job became.
    int attempt = 0;                    ///< Of a State event.
};

struct NewJob {
    JobKey key{};
    std::string request_id{};  ///< Empty: no protection against repetition.
    std::string spec{};
    int priority = 0;
    int max_attempts = 1;
    std::vector<std::string> inputs{};  ///< SHA-256 of each; must be there.
};

struct Creation {
    enum class Verdict { Created, Repeated, Conflict, QueueFull, MissingInput };
    Verdict verdict = Verdict::Created;
    std::optional<JobRecord> job{};  ///< When Created or Repeated.
    std::string missing{};           ///< The first missing input.
};

/// A worker's right to write, handed out by `claim`.
struct Claim {
    JobKey key{};
    std::int64_t epoch = 0;
};

/// How an attempt ended.
struct Settlement {
    JobState state = JobState::Failed;  ///< Terminal.
    std::string outcome{};
    std::vector<NewEvent> events{};     ///< That come before the end.
    std::vector<ArtifactId> outputs{};  ///< Become visible with the end, if it is Succeeded.
};

struct ListQuery {
    std::string tenant{};
    std::vector<JobState> states{};        ///< Empty: all.
    std::optional<std::int64_t> before{};  ///< Only jobs with a smaller number.
    std::size_t limit = 100;
};

/// What the store tells about the jobs of all tenants.
struct StoreFigures {
    std::map<JobState, std::int64_t> jobs{};  ///< States that no job is in are left out.
    std::optional<Time> oldest_queued{};      ///< When the job that waits longest was created.
};

/// What outlives the process: jobs, their events, and which artifacts exist and who needs them.
///
/// The job machine; every arrow is one atomic, durable step that appends one State event:
///
///     Queued --claim--> Running --settle--> Succeeded | Failed
///       |                  |  '--give_back--> Queued          (the attempt isn't spent)
///       |                  |  '--lose-------> Queued, or Quarantined after max_attempts
///       |            request_cancel
///       |                  v
///       |              Cancelling --settle, give_back, lose--> Cancelled
///       '--request_cancel--> Cancelled
///
/// What a worker writes is fenced: with an old epoch nothing changes and the answer is "no".
/// All calls may come from any thread. All throw StoreError if the store can't do its work.
class JobStore {
public:
    JobStore() = default;
    JobStore(const JobStore&) = delete;
    JobStore& operator=(const JobStore&) = delete;
    virtual ~JobStore() = default;

    /// Adds a job, unless the request id is known, `max_queued` jobs wait or an input is missing.
    virtual Creation create(const NewJob& job, std::int64_t max_queued, Time now) = 0;
    virtual std::optional<JobRecord> find(const JobKey& key) = 0;
    /// Newest first.
    virtual std::vector<JobRecord> list(const ListQuery& query) = 0;
    /// Jobs of any tenant that would be claimed before this one; 0 unless it is Queued.
    virtual std::int64_t queue_position(const JobRecord& job) = 0;
    /// Events after a sequence, in order, at most `limit`.
    virtual std::vector<StoredEvent> events_after(const JobKey& key, std::int64_t sequence,
                                                  std::size_t limit) = 0;

    /// Takes the queued job of highest priority, the oldest first.
    virtual std::optional<JobRecord> claim(Time now) = 0;
    /// Adds events of a running attempt, and the previews that they name.
    /// \return the job's last sequence, or nothing if the claim is void
    virtual std::optional<std::int64_t> append(const Claim& claim, std::span<const NewEvent> events,
                                               std::span<const ArtifactId> previews, Time now) = 0;
    /// Ends an attempt for good. A Cancelling job becomes Cancelled whatever was handed in.
    virtual std::optional<JobRecord> settle(const Claim& claim, const Settlement& settlement,
                                            Time now) = 0;
    /// Ends an attempt as if it hadn't been.
    virtual std::optional<JobRecord> give_back(const Claim& claim, Time now) = 0;
    /// Ends an attempt whose worker is gone. `outcome` is for a job that is Quarantined by it.
    virtual std::optional<JobRecord> lose(const Claim& claim, const std::string& outcome,
                                          Time now) = 0;
    /// Every Running or Cancelling job: what a server that owns the store alone finds at its start.
    virtual std::vector<JobRecord> unsettled() = 0;

    /// Cancels a queued job, asks a running one to stop, leaves a terminal one as it is.
    virtual std::optional<JobRecord> request_cancel(const JobKey& key, Time now) = 0;

    enum class Removal { Removed, NotFound, NotTerminal, OtherRevision };
    /// Deletes a terminal job and its events. Its artifacts stay until `remove_artifact`.
    /// \param revision  if given, the job must still have it
    /// \param artifacts  gets the digests that the job referred to
    virtual Removal remove(const JobKey& key, std::optional<std::int64_t> revision,
                           std::vector<std::string>* artifacts) = 0;

    /// Records that an artifact is there. Does nothing if it was known.
    virtual void add_artifact(const std::string& tenant, const ArtifactId& artifact, Time now) = 0;
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
};

}  // namespace remesh
