#include <algorithm>

#include "server/store/fair_share.h"
#include "tests/support/model_job_store.h"

namespace remesh::testing {
namespace {

bool is_ready(const JobRecord& job, Time now) {
    return job.state == JobState::Queued && (!job.retry_time || *job.retry_time <= now ||
                                             *job.retry_time > now + JobStore::kLongestRetry);
}

}  // namespace

std::optional<JobRecord> ModelJobStore::claim(const ClaimRequest& request, Time now) {
    const std::scoped_lock lock(mutex_);
    std::map<std::string, TenantLoad> by_tenant;
    for (const Entry& entry : jobs_) {
        if (is_ready(entry.job, now)) {
            const std::string& tenant = entry.job.key.tenant;
            const TenantPolicy& own = policies_[tenant];
            by_tenant[tenant] = {
                tenant, own.weight,
                count(JobState::Running, tenant) + count(JobState::Cancelling, tenant),
                own.max_running ? own.max_running : request.max_running_of_tenant, used_[tenant]};
        }
    }
    std::vector<TenantLoad> loads;
    for (const auto& [tenant, load] : by_tenant) {
        loads.push_back(load);
    }
    const auto chosen = next_tenant(loads, level_);
    if (!chosen) {
        return std::nullopt;
    }
    const TenantLoad& load = loads[*chosen];
    level_ = std::max(load.used, level_);
    used_[load.tenant] = level_ + charge_of_claim(load.weight);
    Entry* first = nullptr;
    for (Entry& entry : jobs_) {
        if (entry.job.key.tenant == load.tenant && is_ready(entry.job, now) &&
            (!first || order_of(entry.job) < order_of(first->job))) {
            first = &entry;
        }
    }
    ++first->job.attempt;
    ++first->job.epoch;
    first->job.worker = request.worker;
    first->job.beat = 0;
    return enter(*first, JobState::Running, now);
}

std::optional<JobState> ModelJobStore::renew(const Claim& claim) {
    const std::scoped_lock lock(mutex_);
    Entry* entry = claimed(claim);
    if (!entry) {
        return std::nullopt;
    }
    ++entry->job.beat;
    return entry->job.state;
}

std::optional<std::int64_t> ModelJobStore::append(const Claim& claim,
                                                  std::span<const NewEvent> events,
                                                  std::span<const ArtifactId> previews, Time now) {
    const std::scoped_lock lock(mutex_);
    Entry* entry = claimed(claim);
    if (!entry) {
        return std::nullopt;
    }
    append_to(*entry, events);
    for (const ArtifactId& preview : previews) {
        artifacts_.try_emplace({claim.key.tenant, preview.sha256}, preview.size, now);
        entry->references.insert({"preview", preview.sha256});
    }
    return entry->job.last_sequence;
}

std::optional<JobRecord> ModelJobStore::settle(const Claim& claim, const Settlement& settlement,
                                               Time now) {
    const std::scoped_lock lock(mutex_);
    Entry* entry = claimed(claim);
    if (!entry) {
        return std::nullopt;
    }
    charge(entry->job, now);
    append_to(*entry, settlement.events);
    if (entry->job.state == JobState::Cancelling) {
        return enter(*entry, JobState::Cancelled, now);
    }
    entry->job.outcome = settlement.outcome;
    for (const ArtifactId& output : settlement.outputs) {
        artifacts_.try_emplace({claim.key.tenant, output.sha256}, output.size, now);
        entry->references.insert({"output", output.sha256});
    }
    return enter(*entry, settlement.state, now);
}

std::optional<JobRecord> ModelJobStore::give_back(const Claim& claim, Time now) {
    const std::scoped_lock lock(mutex_);
    Entry* entry = claimed(claim);
    if (!entry) {
        return std::nullopt;
    }
    charge(entry->job, now);
    if (entry->job.state == JobState::Cancelling) {
        return enter(*entry, JobState::Cancelled, now);
    }
    --entry->job.attempt;
    return enter(*entry, JobState::Queued, now);
}

std::optional<JobRecord> ModelJobStore::lose(const Claim& claim, const Loss& loss, Time now) {
    const std::scoped_lock lock(mutex_);
    Entry* entry = claimed(claim);
    if (!entry || (loss.seen_beat && *loss.seen_beat != entry->job.beat)) {
        return std::nullopt;
    }
    charge(entry->job, now);
    if (entry->job.state == JobState::Cancelling) {
        return enter(*entry, JobState::Cancelled, now);
    }
    entry->job.crashes += loss.is_crash ? 1 : 0;
    if (entry->job.crashes >= loss.max_crashes || entry->job.attempt >= entry->job.max_attempts) {
        entry->job.outcome = loss.outcome;
        return enter(*entry, loss.last_state, now);
    }
    entry->job.retry_time = loss.retry_time;
    return enter(*entry, JobState::Queued, now);
}

std::vector<JobRecord> ModelJobStore::held() {
    const std::scoped_lock lock(mutex_);
    std::vector<JobRecord> found;
    for (const Entry& entry : jobs_) {
        if (is_held(entry.job.state)) {
            found.push_back(entry.job);
        }
    }
    return found;
}

ModelJobStore::Entry* ModelJobStore::claimed(const Claim& claim) {
    Entry* entry = entry_of(claim.key);
    return entry && entry->job.epoch == claim.epoch && is_held(entry->job.state) ? entry : nullptr;
}

void ModelJobStore::charge(const JobRecord& job, Time now) {
    used_[job.key.tenant] +=
        charge_of_attempt(now - *job.start_time, policies_[job.key.tenant].weight);
}

void ModelJobStore::append_to(Entry& entry, std::span<const NewEvent> events) {
    for (const NewEvent& event : events) {
        entry.events.push_back({++entry.job.last_sequence, event.kind, event.time, event.payload});
        changes_.push_back(entry.job.key);
    }
    changed_.notify_all();
}

}  // namespace remesh::testing
