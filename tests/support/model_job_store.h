#pragma once

#include <algorithm>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "server/store/fair_share.h"
#include "server/store/job_store.h"

namespace remesh::testing {

/// A store that forgets: what JobStore promises, written as plainly as possible, to compare real
/// engines with.
class ModelJobStore final : public JobStore {
public:
    Creation create(const NewJob& job, const QueueLimits& limits, Time now) override {
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

    std::optional<JobRecord> find(const JobKey& key) override {
        const std::scoped_lock lock(mutex_);
        const Entry* entry = entry_of(key);
        return entry ? std::optional(entry->job) : std::nullopt;
    }

    std::vector<JobRecord> list(const ListQuery& query) override {
        const std::scoped_lock lock(mutex_);
        std::vector<JobRecord> found;
        for (auto entry = jobs_.rbegin(); entry != jobs_.rend(); ++entry) {
            const JobRecord& job = entry->job;
            const bool has_state = query.states.empty() ||
                                   std::find(query.states.begin(), query.states.end(), job.state) !=
                                       query.states.end();
            if (job.key.tenant == query.tenant && has_state &&
                (!query.before || job.number < *query.before) && found.size() < query.limit) {
                found.push_back(job);
            }
        }
        return found;
    }

    std::int64_t queue_position(const JobRecord& job) override {
        const std::scoped_lock lock(mutex_);
        if (job.state != JobState::Queued) {
            return 0;
        }
        return std::count_if(jobs_.begin(), jobs_.end(), [&](const Entry& entry) {
            return entry.job.state == JobState::Queued && entry.job.key.tenant == job.key.tenant &&
                   order_of(entry.job) < order_of(job);
        });
    }

    std::vector<StoredEvent> events_after(const JobKey& key, std::int64_t sequence,
                                          std::size_t limit) override {
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

    std::string last_progress(const JobKey& key) override {
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

    std::unique_ptr<ChangeFeed> follow() override {
        const std::scoped_lock lock(mutex_);
        return std::make_unique<Feed>(*this, changes_.size());
    }

    std::optional<JobRecord> claim(const ClaimRequest& request, Time now) override {
        const std::scoped_lock lock(mutex_);
        std::map<std::string, TenantLoad> by_tenant;
        for (const Entry& entry : jobs_) {
            if (is_ready(entry.job, now)) {
                const std::string& tenant = entry.job.key.tenant;
                const TenantPolicy& own = policies_[tenant];
                by_tenant[tenant] = {
                    tenant, own.weight,
                    count(JobState::Running, tenant) + count(JobState::Cancelling, tenant),
                    own.max_running ? own.max_running : request.max_running_of_tenant,
                    used_[tenant]};
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

    std::optional<JobState> renew(const Claim& claim) override {
        const std::scoped_lock lock(mutex_);
        Entry* entry = claimed(claim);
        if (!entry) {
            return std::nullopt;
        }
        ++entry->job.beat;
        return entry->job.state;
    }

    std::optional<std::int64_t> append(const Claim& claim, std::span<const NewEvent> events,
                                       std::span<const ArtifactId> previews, Time now) override {
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

    std::optional<JobRecord> settle(const Claim& claim, const Settlement& settlement,
                                    Time now) override {
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

    std::optional<JobRecord> give_back(const Claim& claim, Time now) override {
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

    std::optional<JobRecord> lose(const Claim& claim, const Loss& loss, Time now) override {
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
        if (entry->job.crashes >= loss.max_crashes ||
            entry->job.attempt >= entry->job.max_attempts) {
            entry->job.outcome = loss.outcome;
            return enter(*entry, loss.last_state, now);
        }
        entry->job.retry_time = loss.retry_time;
        return enter(*entry, JobState::Queued, now);
    }

    std::vector<JobRecord> held() override {
        const std::scoped_lock lock(mutex_);
        std::vector<JobRecord> found;
        for (const Entry& entry : jobs_) {
            if (is_held(entry.job.state)) {
                found.push_back(entry.job);
            }
        }
        return found;
    }

    std::optional<JobRecord> request_cancel(const JobKey& key, Time now) override {
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

    Removal remove(const JobKey& key, std::optional<std::int64_t> revision,
                   std::vector<std::string>* artifacts) override {
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

    std::vector<JobKey> ended_before(Time time, std::size_t limit) override {
        const std::scoped_lock lock(mutex_);
        auto keys = ended([time](Time end) { return end < time; });
        keys.resize(std::min(keys.size(), limit));
        return keys;
    }

    std::vector<JobKey> ended_since(const std::optional<std::string>& tenant, Time time,
                                    std::size_t limit) override {
        const std::scoped_lock lock(mutex_);
        auto keys = ended([time](Time end) { return end >= time; });
        std::erase_if(keys, [&](const JobKey& key) { return tenant && key.tenant != *tenant; });
        std::reverse(keys.begin(), keys.end());
        keys.resize(std::min(keys.size(), limit));
        return keys;
    }

    std::optional<std::chrono::microseconds> mean_run_time(const std::string& tenant,
                                                           std::size_t count) override {
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

    bool add_artifact(const std::string& tenant, const ArtifactId& artifact,
                      std::optional<std::int64_t> max_bytes, Time now) override {
        const std::scoped_lock lock(mutex_);
        if (artifacts_.contains({tenant, artifact.sha256})) {
            return true;
        }
        const auto limit = policies_[tenant].max_bytes ? policies_[tenant].max_bytes : max_bytes;
        if (limit && bytes_of(tenant) + artifact.size > *limit) {
            return false;
        }
        artifacts_[{tenant, artifact.sha256}] = {artifact.size, now};
        return true;
    }

    std::optional<ArtifactId> find_artifact(const std::string& tenant,
                                            const std::string& sha256) override {
        const std::scoped_lock lock(mutex_);
        const auto found = artifacts_.find({tenant, sha256});
        return found == artifacts_.end() ? std::nullopt
                                         : std::optional(ArtifactId{sha256, found->second.first});
    }

    std::vector<std::string> drop_previews(const JobKey& key,
                                           std::span<const std::string> keep) override {
        const std::scoped_lock lock(mutex_);
        std::vector<std::string> dropped;
        if (Entry* entry = entry_of(key)) {
            std::erase_if(entry->references, [&](const auto& reference) {
                const bool is_dropped =
                    reference.first == "preview" &&
                    std::find(keep.begin(), keep.end(), reference.second) == keep.end();
                if (is_dropped) {
                    dropped.push_back(reference.second);
                }
                return is_dropped;
            });
        }
        return dropped;
    }

    bool remove_artifact(const std::string& tenant, const std::string& sha256) override {
        const std::scoped_lock lock(mutex_);
        return !is_needed({tenant, sha256}) && artifacts_.erase({tenant, sha256}) > 0;
    }

    std::vector<JobKey> unreferenced_artifacts(Time before) override {
        const std::scoped_lock lock(mutex_);
        std::vector<JobKey> found;
        for (const auto& [key, what] : artifacts_) {
            if (what.second < before && !is_needed(key)) {
                found.push_back(key);
            }
        }
        return found;
    }

    StoreFigures figures() override {
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

    std::vector<TenantBacklog> backlogs() override {
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

    std::int64_t stored_bytes(const std::string& tenant) override {
        const std::scoped_lock lock(mutex_);
        return bytes_of(tenant);
    }

    void set_policy(const std::string& tenant, const TenantPolicy& policy) override {
        const std::scoped_lock lock(mutex_);
        policies_[tenant] = policy;
    }
    TenantPolicy policy(const std::string& tenant) override {
        const std::scoped_lock lock(mutex_);
        return policies_[tenant];
    }

private:
    struct Entry {
        JobRecord job{};
        std::string request_id{};
        std::string cache_key{};
        std::vector<StoredEvent> events{};
        std::set<std::pair<std::string, std::string>> references{};  // role, SHA-256
    };

    class Feed final : public ChangeFeed {
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

    // All of these need mutex_.

    static Creation refusal(Creation::Verdict verdict, const Entry* entry = nullptr,
                            std::int64_t limit = 0) {
        return {verdict, entry ? std::optional(entry->job) : std::nullopt, {}, limit};
    }
    static std::pair<int, std::int64_t> order_of(const JobRecord& job) {
        return {-job.priority, job.number};
    }
    static bool is_ready(const JobRecord& job, Time now) {
        return job.state == JobState::Queued &&
               (!job.retry_time || *job.retry_time <= now || *job.retry_time > now + kLongestRetry);
    }
    Entry* entry_of(const JobKey& key) {
        const auto found = std::find_if(jobs_.begin(), jobs_.end(),
                                        [&](const Entry& entry) { return entry.job.key == key; });
        return found == jobs_.end() ? nullptr : &*found;
    }
    Entry* claimed(const Claim& claim) {
        Entry* entry = entry_of(claim.key);
        return entry && entry->job.epoch == claim.epoch && is_held(entry->job.state) ? entry
                                                                                     : nullptr;
    }
    /// The jobs whose end is as wanted, by it.
    template <typename IsWanted>
    std::vector<JobKey> ended(IsWanted is_wanted) const {
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
    std::int64_t count(JobState state, const std::optional<std::string>& tenant = {}) const {
        return std::count_if(jobs_.begin(), jobs_.end(), [&](const Entry& entry) {
            return entry.job.state == state && (!tenant || entry.job.key.tenant == *tenant);
        });
    }
    std::int64_t bytes_of(const std::string& tenant) const {
        std::int64_t sum = 0;
        for (const auto& [key, what] : artifacts_) {
            sum += key.tenant == tenant ? what.first : 0;
        }
        return sum;
    }
    bool is_needed(const JobKey& artifact) const {
        return std::any_of(jobs_.begin(), jobs_.end(), [&](const Entry& entry) {
            return entry.job.key.tenant == artifact.tenant &&
                   std::any_of(entry.references.begin(), entry.references.end(),
                               [&](const auto& pair) { return pair.second == artifact.id; });
        });
    }
    JobRecord add(const NewJob& job, Time now) {
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
        const Entry* source = nullptr;
        if (job.may_reuse && !job.cache_key.empty()) {
            for (const Entry& other : jobs_) {
                if (other.job.key.tenant == job.key.tenant && other.cache_key == job.cache_key &&
                    other.job.state == JobState::Succeeded) {
                    source = &other;
                }
            }
        }
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
    void charge(const JobRecord& job, Time now) {
        used_[job.key.tenant] +=
            charge_of_attempt(now - *job.start_time, policies_[job.key.tenant].weight);
    }
    JobRecord enter(Entry& entry, JobState state, Time now) {
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
        entry.events.push_back(
            {++job.last_sequence, EventKind::State, now, {}, state, job.attempt});
        changes_.push_back(job.key);
        changed_.notify_all();
        return job;
    }
    void append_to(Entry& entry, std::span<const NewEvent> events) {
        for (const NewEvent& event : events) {
            entry.events.push_back(
                {++entry.job.last_sequence, event.kind, event.time, event.payload});
            changes_.push_back(entry.job.key);
        }
        changed_.notify_all();
    }

    std::mutex mutex_;
    std::condition_variable_any changed_;
    std::vector<Entry> jobs_;  // by number
    std::int64_t last_number_ = 0;
    std::map<JobKey, std::pair<std::int64_t, Time>> artifacts_;  // size and time
    std::map<std::string, TenantPolicy> policies_;
    std::map<std::string, std::int64_t> used_;
    std::int64_t level_ = 0;
    std::vector<JobKey> changes_;
};

}  // namespace remesh::testing
