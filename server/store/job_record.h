#pragma once

#include <array>
#include <chrono>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
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
    enum class Kind {
        Failed,
        Full,  ///< The disk takes no more; what is there is whole.
        Lost,  ///< The bytes of an artifact are gone or no longer what they were.
    };

    explicit StoreError(const std::string& message, Kind kind = Kind::Failed)
        : std::runtime_error(message), kind_(kind) {}

    [[nodiscard]] Kind kind() const noexcept { return kind_; }

private:
    Kind kind_;
};

enum class JobState { Queued, Running, Cancelling, Succeeded, Failed, Cancelled, Quarantined };

/// In the order of JobState, as they are stored, logged and counted.
inline constexpr std::array<std::string_view, 7> kStateNames{
    "queued", "running", "cancelling", "succeeded", "failed", "cancelled", "quarantined"};

[[nodiscard]] constexpr std::string_view state_name(JobState state) {
    return kStateNames[static_cast<std::size_t>(state)];
}

[[nodiscard]] constexpr bool is_terminal(JobState state) {
    return state >= JobState::Succeeded;
}

/// Whether a worker holds it.
[[nodiscard]] constexpr bool is_held(JobState state) {
    return state == JobState::Running || state == JobState::Cancelling;
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
    /// Present or last one, from 1; an attempt that was given back isn't counted.
    int attempt = 0;
    int max_attempts = 1;
    int crashes = 0;            ///< Attempts whose worker died of them.
    std::int64_t epoch = 0;     ///< Times claimed: only the claim of this epoch may write.
    std::string worker{};       ///< Who holds it; empty unless it is Running or Cancelling.
    std::int64_t beat = 0;      ///< Changes while its worker is alive.
    std::int64_t revision = 0;  ///< Changes with every State event.
    Time create_time{};
    std::optional<Time> start_time{};  ///< Of the present or last attempt, >= create_time.
    std::optional<Time> end_time{};    ///< When it became terminal, >= start_time.
    std::optional<Time> retry_time{};  ///< Of a Queued job that waits after a lost attempt.
    std::string outcome{};             ///< Of a terminal job, empty if it was Cancelled; opaque.
    std::string origin{};              ///< Id of the job that this one repeats, or empty.
    std::int64_t last_sequence = 0;

    bool operator==(const JobRecord&) const = default;
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

    bool operator==(const StoredEvent&) const = default;
};

struct NewJob {
    JobKey key{};
    std::string request_id{};  ///< Empty: no protection against repetition.
    std::string spec{};
    int priority = 0;
    int max_attempts = 1;
    std::vector<std::string> inputs{};  ///< SHA-256 of each; must be there.
    std::string cache_key{};            ///< Equal for jobs with equal results; empty: unknown.
    bool may_reuse = false;             ///< Whether a result with this cache key answers it.
    std::string origin{};
};

/// How much may wait and be kept. A tenant's own policy goes before the last two.
struct QueueLimits {
    std::int64_t max_queued = 1'000;
    std::int64_t max_queued_of_tenant = 1'000;
    std::optional<std::int64_t> max_bytes_of_tenant{};
};

/// What one tenant may use; absent: as much as any.
struct TenantPolicy {
    int weight = 1;  ///< Its share of the workers against other tenants', in [1, 1000].
    std::optional<std::int64_t> max_running{};
    std::optional<std::int64_t> max_queued{};
    std::optional<std::int64_t> max_bytes{};  ///< Of artifacts, inputs and results together.

    bool operator==(const TenantPolicy&) const = default;
};

struct Creation {
    enum class Verdict {
        Created,   ///< Also if it was answered by another's result and is Succeeded already.
        Repeated,  ///< Known by its request id.
        Conflict,  ///< The request id is known with another spec.
        QueueFull,
        TenantQueueFull,
        TenantBytesFull,
        MissingInput,
    };
    Verdict verdict = Verdict::Created;
    std::optional<JobRecord> job{};  ///< When Created or Repeated.
    std::string missing{};           ///< The first missing input.
    std::int64_t limit = 0;          ///< That was reached.
};

struct ClaimRequest {
    std::string worker{};                                 ///< Who will hold the job.
    std::optional<std::int64_t> max_running_of_tenant{};  ///< Unless its policy says otherwise.
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
    std::vector<ArtifactId> outputs{};  ///< Become visible with the end, unless it is Cancelled.
};

/// How an attempt was lost.
struct Loss {
    bool is_crash = false;                    ///< Its worker died of it.
    int max_crashes = 2;                      ///< As many crashes end the job.
    JobState last_state = JobState::Failed;   ///< Of a job that isn't tried again.
    std::string outcome{};                    ///< Of such a job.
    Time retry_time{};                        ///< When another one is tried again.
    std::optional<std::int64_t> seen_beat{};  ///< If given, the beat must still be this.
};

struct ListQuery {
    std::string tenant{};
    std::vector<JobState> states{};        ///< Empty: all.
    std::optional<std::int64_t> before{};  ///< Only jobs with a smaller number.
    std::size_t limit = 100;
};

/// What a tenant waits for.
struct TenantBacklog {
    std::string tenant{};
    std::int64_t queued = 0;
    std::int64_t running = 0;             ///< Those that are being cancelled, too.
    std::optional<Time> oldest_queued{};  ///< When the job that waits longest was created.

    bool operator==(const TenantBacklog&) const = default;
};

/// What the store tells about the jobs of all tenants.
struct StoreFigures {
    std::map<JobState, std::int64_t> jobs{};  ///< States that no job is in are left out.
    std::optional<Time> oldest_queued{};      ///< When the job that waits longest was created.

    bool operator==(const StoreFigures&) const = default;
};

}  // namespace remesh
