#include "server/queue_service.h"

#include <chrono>
#include <utility>

#include "server/call.h"
#include "server/convert.h"

namespace remesh {
namespace {

constexpr Rule kSummarize{"SummarizeQueue", Role::Viewer, false};
constexpr std::chrono::minutes kInterval{1};
constexpr int kIntervals = 60;
constexpr std::size_t kMaxEnded = 10'000;

/// A tenant without any job.
v1::TenantSummary empty_summary(const std::string& tenant) {
    v1::TenantSummary summary;
    summary.set_tenant(tenant);
    for (auto* list :
         {summary.mutable_succeeded(), summary.mutable_failed(), summary.mutable_cancelled()}) {
        list->Resize(kIntervals, 0);
    }
    summary.mutable_tets()->Resize(kIntervals, 0);
    return summary;
}

auto* list_for(v1::TenantSummary& summary, JobState state) {
    return state == JobState::Succeeded   ? summary.mutable_succeeded()
           : state == JobState::Cancelled ? summary.mutable_cancelled()
                                          : summary.mutable_failed();
}

}  // namespace

QueueService::QueueService(Reception& reception, JobStore& store, JobRegistry& registry,
                           Clock clock)
    : reception_(reception), store_(store), registry_(registry), clock_(std::move(clock)) {}

QueueService::Ended QueueService::look_at(const JobKey& key) {
    {
        const std::scoped_lock lock(mutex_);
        if (const auto known = ended_.find(key); known != ended_.end()) {
            return known->second;
        }
    }
    const JobView job = registry_.get(key);
    const bool was_run = job.job.attempt > 0;
    const Ended ended{job.job.state, *job.job.end_time,
                      was_run ? to_proto(job).result().quality().tets().tets() : 0};
    const std::scoped_lock lock(mutex_);
    ended_[key] = ended;
    return ended;
}

std::vector<std::pair<std::string, QueueService::Ended>> QueueService::ended_since(
    const std::optional<std::string>& tenant, Time start) {
    const auto keys = store_.ended_since(tenant, start, kMaxEnded);
    {
        const std::scoped_lock lock(mutex_);
        std::erase_if(ended_, [&](const auto& known) { return known.second.end < start; });
    }
    std::vector<std::pair<std::string, Ended>> jobs;
    for (const JobKey& key : keys) {
        try {
            jobs.emplace_back(key.tenant, look_at(key));
        } catch (const JobError&) {
            continue;  // Deleted meanwhile.
        }
    }
    return jobs;
}

v1::SummarizeQueueResponse QueueService::summarize(const Principal& who) {
    const Time start =
        std::chrono::floor<std::chrono::minutes>(clock_()) - (kIntervals - 1) * kInterval;
    std::map<std::string, v1::TenantSummary> tenants;
    const auto summary_of = [&](const std::string& tenant) -> v1::TenantSummary& {
        const auto known = tenants.find(tenant);
        return known != tenants.end()
                   ? known->second
                   : tenants.emplace(tenant, empty_summary(tenant)).first->second;
    };
    // What a tenant is told doesn't depend on what others do.
    const auto whose =
        who.role == Role::Operator ? std::nullopt : std::optional<std::string>(who.tenant);
    summary_of(who.tenant);
    for (const TenantBacklog& backlog : store_.backlogs()) {
        if (whose && backlog.tenant != *whose) {
            continue;
        }
        v1::TenantSummary& summary = summary_of(backlog.tenant);
        summary.set_queued(static_cast<std::int32_t>(backlog.queued));
        summary.set_running(static_cast<std::int32_t>(backlog.running));
        if (backlog.oldest_queued) {
            *summary.mutable_oldest_queued_time() = to_proto(*backlog.oldest_queued);
        }
    }
    for (const auto& [tenant, job] : ended_since(whose, start)) {
        const auto interval = static_cast<int>((job.end - start) / kInterval);
        if (interval <
            kIntervals) {  // A clock that was set back leaves jobs that end in the future.
            v1::TenantSummary& summary = summary_of(tenant);
            ++*list_for(summary, job.state)->Mutable(interval);
            *summary.mutable_tets()->Mutable(interval) += job.tets;
        }
    }
    v1::SummarizeQueueResponse reply;
    *reply.mutable_start_time() = to_proto(start);
    reply.mutable_interval()->set_seconds(std::chrono::seconds(kInterval).count());
    reply.set_own_tenant(who.tenant);
    for (auto& [tenant, summary] : tenants) {
        *reply.add_tenants() = std::move(summary);
    }
    return reply;
}

grpc::ServerUnaryReactor* QueueService::SummarizeQueue(grpc::CallbackServerContext* context,
                                                       const v1::SummarizeQueueRequest* request,
                                                       v1::SummarizeQueueResponse* reply) {
    return reception_.answer(
        {context, request, reply}, kSummarize,
        [=, this](const Principal& who, std::string&) { *reply = summarize(who); });
}

}  // namespace remesh
