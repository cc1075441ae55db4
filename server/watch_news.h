#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/slice.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>

#include "remesh/v1/job.pb.h"
#include "server/jobs/registry.h"
#include "server/tenant_slots.h"

namespace remesh {

/// A v1::JobEvent as it is sent. Copies share its bytes, and the room that they take.
struct WatchMessage {
    grpc::ByteBuffer bytes{};
    std::shared_ptr<void> room{};
};

/// A message that says no more than this.
[[nodiscard]] WatchMessage written(const v1::JobEvent& event);

/// What the watchers of jobs are told, read and written down once for all of a job's: a job is told
/// with its spec, which may have 1.5 MiB. For one thread.
class WatchNews {
public:
    /// \param bytes  of messages about whole jobs that aren't sent yet; must outlive the messages
    /// \param max_age  a queued job's place changes without any event of its own
    WatchNews(JobRegistry& registry, TenantSlots& bytes,
              std::chrono::milliseconds max_age = std::chrono::seconds(1))
        : registry_(registry), bytes_(bytes), max_age_(max_age) {}

    /// The job as it stood when `expire` was called last or later, and not longer ago than the
    /// longest age.
    /// \throws JobError{NotFound}
    const JobView& view(const JobKey& key);
    /// Tells the whole job as `view` does.
    /// \throws StatusError{RESOURCE_EXHAUSTED} if the tenant has too much that isn't sent
    WatchMessage snapshot(const JobKey& key);
    /// \param skipped  events that were left out before this one
    WatchMessage message(const JobKey& key, const StoredEvent& event, std::int64_t skipped);

    /// The job has changed.
    void expire(const JobKey& key);
    /// Nobody watches the job any more.
    void forget(const JobKey& key);

private:
    using SteadyTime = std::chrono::steady_clock::time_point;

    struct Shared {
        grpc::Slice bytes{};
        std::shared_ptr<void> room{};

        [[nodiscard]] std::int64_t size() const { return static_cast<std::int64_t>(bytes.size()); }
    };
    struct News {
        JobView view{};
        SteadyTime read_time{};
        bool is_old = false;
        std::int64_t last_use = 0;
        std::int64_t size = 0;  ///< Of all this, about.
        std::optional<Shared> snapshot{};
        std::map<std::int64_t, Shared> changes{};  ///< State events, by sequence.
    };

    News& up_to_date(const JobKey& key);
    /// What was written down of its changes stays.
    News& read(const JobKey& key);
    Shared share(const JobKey& key, News& news, const v1::JobEvent& event);
    void drop(std::map<JobKey, News>::iterator job);
    /// Drops what was used least if there is too much then, but not `news`.
    void resize(News& news, std::int64_t change);

    JobRegistry& registry_;
    TenantSlots& bytes_;
    const std::chrono::milliseconds max_age_;
    std::map<JobKey, News> jobs_;
    std::int64_t uses_ = 0;
    std::int64_t size_ = 0;  // of all jobs
};

}  // namespace remesh
