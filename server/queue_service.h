#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "remesh/v1/queue.grpc.pb.h"
#include "server/jobs/registry.h"
#include "server/reception.h"

namespace remesh {

/// Tells how busy the server is. Reads the store when asked and keeps what it made of the jobs that
/// ended, so that each is looked at once.
class QueueService final : public v1::QueueService::CallbackService {
public:
    using Clock = std::function<Time()>;

    QueueService(Reception& reception, JobStore& store, JobRegistry& registry,
                 Clock clock = system_now);

    grpc::ServerUnaryReactor* SummarizeQueue(grpc::CallbackServerContext* context,
                                             const v1::SummarizeQueueRequest* request,
                                             v1::SummarizeQueueResponse* reply) override;

private:
    /// What a job that ended counts for.
    struct Ended {
        JobState state{};
        Time end{};
        std::int64_t tets = 0;
    };

    [[nodiscard]] v1::SummarizeQueueResponse summarize(const Principal& who);
    /// Tenants and jobs, of one tenant or all, that ended at `start` or later.
    [[nodiscard]] std::vector<std::pair<std::string, Ended>> ended_since(
        const std::optional<std::string>& tenant, Time start);
    /// \throws JobError if there is no such job
    Ended look_at(const JobKey& key);

    Reception& reception_;
    JobStore& store_;
    JobRegistry& registry_;
    const Clock clock_;

    std::mutex mutex_;
    std::map<JobKey, Ended> ended_;  // needs mutex_; what was looked at
};

}  // namespace remesh
