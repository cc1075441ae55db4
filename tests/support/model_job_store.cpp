#include "tests/support/model_job_store.h"

#include <algorithm>
#include <tuple>

namespace remesh::testing {

class ModelJobStore::Feed final : public ChangeFeed {
public:
    Feed(ModelJobStore& store, std::size_t seen) : store_(store), seen_(seen) {}
    std::vector<JobKey> next(std::chrono::milliseconds timeout,
                             const std::stop_token& stop) override {
        std::unique_lock lock(store_.mutex_);
        store_.changed_.wait_for(lock, stop, timeout,
                                 [this] { return store_.changes_.size() > seen_; });
        std::set<JobKey> keys;
        for (; seen_ < store_.changes_.size(); ++seen_) {
            if (store_.entry_of(store_.changes_[seen_])) {
                keys.insert(store_.changes_[seen_]);
            }
        }
        return {keys.begin(), keys.end()};
    }

private:
    ModelJobStore& store_;
    std::size_t seen_;
};

Creation ModelJobStore::create(const NewJob& job, const QueueLimits& limits, Time now) {
    const std::scoped_lock lock(mutex_);
    if (!job.request_id.empty()) {
        for (const Entry& entry : jobs_) {
            if (entry.job.key.tenant == job.key.tenant && entry.request_id == job.request_id) {
                return entry.job.spec == job.spec ? refusal(Creation::Verdict::Repeated, &entry)
                                                  : refusal(Creation::Verdict::Conflict);
            }
        }
    }
    for (const std::string& input : job.inputs) {
        if (!artifacts_.contains({job.key.tenant, input})) {
            return {Creation::Verdict::MissingInput, {}, input, 0};
        }
    }
    const TenantPolicy own = policies_[job.key.tenant];
    if (count(JobState::Queued) >= limits.max_queued) {
        return refusal(Creation::Verdict::QueueFull, nullptr, limits.max_queued);
    }
    const std::int64_t max_queued = own.max_queued.value_or(limits.max_queued_of_tenant);
    if (count(JobState::Queued, job.key.tenant) >= max_queued) {
        return refusal(Creation::Verdict::TenantQueueFull, nullptr, max_queued);
    }
    const auto max_bytes = own.max_bytes ? own.max_bytes : limits.max_bytes_of_tenant;
    if (max_bytes && bytes_of(job.key.tenant) >= *max_bytes) {
        return refusal(Creation::Verdict::TenantBytesFull, nullptr, *max_bytes);
    }
    return {Creation::Verdict::Created, add(job, now), {}, 0};
}

std::optional<JobRecord> ModelJobStore::find(const JobKey& key) {
    const std::scoped_lock lock(mutex_);
    const Entry* entry = entry_of(key);
    return entry ? std::optional(entry->job) : std::nullopt;
}

std::vector<std::string> ModelJobStore::reusable_outputs(const std::string& tenant,
                                                         const std::string& cache_key) {
    const std::scoped_lock lock(mutex_);
    std::set<std::string> digests;
    if (const Entry* source = result_for(tenant, cache_key)) {
        for (const auto& [role, sha256] : source->references) {
            if (role == "output") {
                digests.insert(sha256);
            }
        }
    }
    return {digests.begin(), digests.end()};
}

std::vector<JobRecord> ModelJobStore::list(const ListQuery& query) {
    const std::scoped_lock lock(mutex_);
    std::vector<JobRecord> found;
    for (auto entry = jobs_.rbegin(); entry != jobs_.rend(); ++entry) {
        const JobRecord& job = entry->job;
        const bool has_state =
            query.states.empty() ||
            std::find(query.states.begin(), query.states.end(), job.state) != query.states.end();
        if (job.key.tenant == query.tenant && has_state &&
            (!query.before || job.number < *query.before) && found.size() < query.limit) {
            found.push_back(job);
        }
    }
    return found;
}

std::int64_t ModelJobStore::queue_position(const JobRecord& job) {
    const std::scoped_lock lock(mutex_);
    if (job.state != JobState::Queued) {
        return 0;
    }
    return std::count_if(jobs_.begin(), jobs_.end(), [&](const Entry& entry) {
        return entry.job.state == JobState::Queued && entry.job.key.tenant == job.key.tenant &&
               order_of(entry.job) < order_of(job);
    });
}

std::vector<StoredEvent> ModelJobStore::events_after(const JobKey& key, std::int64_t sequence,
                                                     std::size_t limit) {
    const std::scoped_lock lock(mutex_);
    std::vector<StoredEvent> found;
    if (const Entry* entry = entry_of(key)) {
        for (const StoredEvent& event : entry->events) {
            if (event.sequence > sequence && found.size() < limit) {
                found.push_back(event);
            }
        }
    }
    return found;
}

std::string ModelJobStore::last_progress(const JobKey& key) {
    const std::scoped_lock lock(mutex_);
    std::string payload;
    if (const Entry* entry = entry_of(key)) {
        for (const StoredEvent& event : entry->events) {
            if (event.kind == EventKind::Progress) {
                payload = event.payload;
            } else if (event.state == JobState::Running && event.kind == EventKind::State) {
                payload.clear();
            }
        }
    }
    return payload;
}

std::unique_ptr<ChangeFeed> ModelJobStore::follow() {
    const std::scoped_lock lock(mutex_);
    return std::make_unique<Feed>(*this, changes_.size());
}

std::optional<JobRecord> ModelJobStore::request_cancel(const JobKey& key, Time now) {
    const std::scoped_lock lock(mutex_);
    Entry* entry = entry_of(key);
    if (!entry) {
        return std::nullopt;
    }
    switch (entry->job.state) {
        case JobState::Queued: return enter(*entry, JobState::Cancelled, now);
        case JobState::Running: return enter(*entry, JobState::Cancelling, now);
        default: return entry->job;
    }
}

JobStore::Removal ModelJobStore::remove(const JobKey& key, std::optional<std::int64_t> revision,
                                        std::vector<std::string>* artifacts) {
    const std::scoped_lock lock(mutex_);
    const Entry* entry = entry_of(key);
    if (!entry) {
        return Removal::NotFound;
    }
    if (!is_terminal(entry->job.state)) {
        return Removal::NotTerminal;
    }
    if (revision && *revision != entry->job.revision) {
        return Removal::OtherRevision;
    }
    std::set<std::string> digests;
    for (const auto& [role, sha256] : entry->references) {
        digests.insert(sha256);
    }
    artifacts->insert(artifacts->end(), digests.begin(), digests.end());
    jobs_.erase(jobs_.begin() + (entry - jobs_.data()));
    return Removal::Removed;
}

template <typename IsWanted>
std::vector<JobKey> ModelJobStore::ended(IsWanted is_wanted) const {
    std::set<std::tuple<Time, std::int64_t, JobKey>> found;
    for (const Entry& entry : jobs_) {
        if (entry.job.end_time && is_wanted(*entry.job.end_time)) {
            found.insert({*entry.job.end_time, entry.job.number, entry.job.key});
        }
    }
    std::vector<JobKey> keys;
    for (const auto& [end, number, key] : found) {
        keys.push_back(key);
    }
    return keys;
}

std::vector<JobKey> ModelJobStore::ended_before(Time time, std::size_t limit) {
    const std::scoped_lock lock(mutex_);
    auto keys = ended([time](Time end) { return end < time; });
    keys.resize(std::min(keys.size(), limit));
    return keys;
}

std::vector<JobKey> ModelJobStore::ended_since(const std::optional<std::string>& tenant, Time time,
                                               std::size_t limit) {
    const std::scoped_lock lock(mutex_);
    auto keys = ended([time](Time end) { return end >= time; });
    std::erase_if(keys, [&](const JobKey& key) { return tenant && key.tenant != *tenant; });
    std::reverse(keys.begin(), keys.end());
    keys.resize(std::min(keys.size(), limit));
    return keys;
}

std::optional<std::chrono::microseconds> ModelJobStore::mean_run_time(const std::string& tenant,
                                                                      std::size_t count) {
    const std::scoped_lock lock(mutex_);
    std::set<std::tuple<Time, std::int64_t, std::chrono::microseconds>> runs;
    for (const Entry& entry : jobs_) {
        if (entry.job.key.tenant == tenant && entry.job.state == JobState::Succeeded &&
            entry.job.attempt > 0) {
            runs.insert({*entry.job.end_time, entry.job.number,
                         *entry.job.end_time - *entry.job.start_time});
        }
    }
    double sum = 0.0;
    std::size_t taken = 0;
    for (auto run = runs.rbegin(); run != runs.rend() && taken < count; ++run, ++taken) {
        sum += static_cast<double>(std::get<2>(*run).count());
    }
    return taken == 0 ? std::nullopt
                      : std::optional(std::chrono::microseconds(
                            static_cast<std::int64_t>(sum / static_cast<double>(taken))));
}

StoreFigures ModelJobStore::figures() {
    const std::scoped_lock lock(mutex_);
    StoreFigures figures;
    for (const Entry& entry : jobs_) {
        const JobRecord& job = entry.job;
        ++figures.jobs[job.state];
        if (job.state == JobState::Queued) {
            figures.oldest_queued =
                std::min(figures.oldest_queued.value_or(job.create_time), job.create_time);
        }
    }
    return figures;
}

std::vector<TenantBacklog> ModelJobStore::backlogs() {
    const std::scoped_lock lock(mutex_);
    std::map<std::string, TenantBacklog> backlogs;
    for (const Entry& entry : jobs_) {
        const JobRecord& job = entry.job;
        if (is_terminal(job.state)) {
            continue;
        }
        TenantBacklog& backlog = backlogs[job.key.tenant];
        backlog.tenant = job.key.tenant;
        if (job.state == JobState::Queued) {
            ++backlog.queued;
            backlog.oldest_queued =
                std::min(backlog.oldest_queued.value_or(job.create_time), job.create_time);
        } else {
            ++backlog.running;
        }
    }
    std::vector<TenantBacklog> sorted;
    for (const auto& [tenant, backlog] : backlogs) {
        sorted.push_back(backlog);
    }
    return sorted;
}

Creation ModelJobStore::refusal(Creation::Verdict verdict, const Entry* entry, std::int64_t limit) {
    return {verdict, entry ? std::optional(entry->job) : std::nullopt, {}, limit};
}

ModelJobStore::Entry* ModelJobStore::entry_of(const JobKey& key) {
    const auto found = std::find_if(jobs_.begin(), jobs_.end(),
                                    [&](const Entry& entry) { return entry.job.key == key; });
    return found == jobs_.end() ? nullptr : &*found;
}

std::int64_t ModelJobStore::count(JobState state, const std::optional<std::string>& tenant) const {
    return std::count_if(jobs_.begin(), jobs_.end(), [&](const Entry& entry) {
        return entry.job.state == state && (!tenant || entry.job.key.tenant == *tenant);
    });
}

ModelJobStore::Entry* ModelJobStore::result_for(const std::string& tenant,
                                                const std::string& cache_key) {
    const auto found = std::find_if(jobs_.rbegin(), jobs_.rend(), [&](const Entry& entry) {
        return !cache_key.empty() && entry.job.key.tenant == tenant &&
               entry.cache_key == cache_key && entry.job.state == JobState::Succeeded;
    });
    return found == jobs_.rend() ? nullptr : &*found;
}

JobRecord ModelJobStore::add(const NewJob& job, Time now) {
    Entry entry;
    entry.job = {.key = job.key, .number = ++last_number_, .spec = job.spec};
    entry.job.priority = job.priority;
    entry.job.max_attempts = job.max_attempts;
    entry.job.create_time = now;
    entry.job.origin = job.origin;
    entry.request_id = job.request_id;
    entry.cache_key = job.cache_key;
    for (const std::string& input : job.inputs) {
        entry.references.insert({"input", input});
    }
    const Entry* source = job.may_reuse ? result_for(job.key.tenant, job.cache_key) : nullptr;
    enter(entry, JobState::Queued, now);
    if (source) {
        for (const auto& [role, sha256] : source->references) {
            if (role == "output") {
                entry.references.insert({role, sha256});
            }
        }
        entry.job.origin = source->job.key.id;
        entry.job.outcome = source->job.outcome;
        entry.job.start_time = now;
        enter(entry, JobState::Succeeded, now);
    }
    jobs_.push_back(std::move(entry));
    return jobs_.back().job;
}

JobRecord ModelJobStore::enter(Entry& entry, JobState state, Time now) {
    JobRecord& job = entry.job;
    now = std::max(now, job.create_time);
    now = job.start_time ? std::max(now, *job.start_time) : now;
    job.state = state;
    ++job.revision;
    if (state == JobState::Running) {
        job.start_time = now;
    }
    if (state != JobState::Queued) {
        job.retry_time.reset();
    }
    if (is_terminal(state)) {
        job.end_time = now;
    }
    if (!is_held(state)) {
        job.worker.clear();
    }
    entry.events.push_back({++job.last_sequence, EventKind::State, now, {}, state, job.attempt});
    changes_.push_back(job.key);
    changed_.notify_all();
    return job;
}

}  // namespace remesh::testing
