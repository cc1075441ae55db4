#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/store/job_store.h"

namespace remesh::testing {

/// A store that forgets: what JobStore promises, written as plainly as possible, to compare real
/// engines with.
class ModelJobStore final : public JobStore {
public:
    Creation create(const NewJob& job, const QueueLimits& limits, Time now) override;
    std::optional<JobRecord> find(const JobKey& key) override;
    std::vector<std::string> reusable_outputs(const std::string& tenant,
                                              const std::string& cache_key) override;
    std::vector<JobRecord> list(const ListQuery& query) override;
    std::int64_t queue_position(const JobRecord& job) override;
    std::vector<StoredEvent> events_after(const JobKey& key, std::int64_t sequence,
                                          std::size_t limit) override;
    std::string last_progress(const JobKey& key) override;
    std::unique_ptr<ChangeFeed> follow() override;
    std::optional<JobRecord> claim(const ClaimRequest& request, Time now) override;
    std::optional<JobState> renew(const Claim& claim) override;
    std::optional<std::int64_t> append(const Claim& claim, std::span<const NewEvent> events,
                                       std::span<const ArtifactId> previews, Time now) override;
    std::optional<JobRecord> settle(const Claim& claim, const Settlement& settlement,
                                    Time now) override;
    std::optional<JobRecord> give_back(const Claim& claim, Time now) override;
    std::optional<JobRecord> lose(const Claim& claim, const Loss& loss, Time now) override;
    std::vector<JobRecord> held() override;
    std::optional<JobRecord> request_cancel(const JobKey& key, Time now) override;
    Removal remove(const JobKey& key, std::optional<std::int64_t> revision,
                   std::vector<std::string>* artifacts) override;
    std::vector<JobKey> ended_before(Time time, std::size_t limit) override;
    std::vector<JobKey> ended_since(const std::optional<std::string>& tenant, Time time,
                                    std::size_t limit) override;
    std::optional<std::chrono::microseconds> mean_run_time(const std::string& tenant,
                                                           std::size_t count) override;
    bool add_artifact(const std::string& tenant, const ArtifactId& artifact,
                      std::optional<std::int64_t> max_bytes, Time now) override;
    std::optional<ArtifactId> find_artifact(const std::string& tenant,
                                            const std::string& sha256) override;
    std::vector<std::string> drop_previews(const JobKey& key,
                                           std::span<const std::string> keep) override;
    bool remove_artifact(const std::string& tenant, const std::string& sha256) override;
    std::vector<JobKey> unreferenced_artifacts(Time before) override;
    StoreFigures figures() override;
    std::vector<TenantBacklog> backlogs() override;
    std::int64_t stored_bytes(const std::string& tenant) override;
    void set_policy(const std::string& tenant, const TenantPolicy& policy) override;
    TenantPolicy policy(const std::string& tenant) override;

private:
    struct Entry {
        JobRecord job{};
        std::string request_id{};
        std::string cache_key{};
        std::vector<StoredEvent> events{};
        std::set<std::pair<std::string, std::string>> references{};  // role, SHA-256
    };
    class Feed;

    // All of these need mutex_.

    static Creation refusal(Creation::Verdict verdict, const Entry* entry = nullptr,
                            std::int64_t limit = 0);
    Entry* entry_of(const JobKey& key);
    Entry* claimed(const Claim& claim);
    /// The job whose result answers those of a cache key.
    Entry* result_for(const std::string& tenant, const std::string& cache_key);
    /// The jobs whose end is as wanted, by it.
    template <typename IsWanted>
    std::vector<JobKey> ended(IsWanted is_wanted) const;
    std::int64_t count(JobState state, const std::optional<std::string>& tenant = {}) const;
    std::int64_t bytes_of(const std::string& tenant) const;
    bool is_needed(const JobKey& artifact) const;
    JobRecord add(const NewJob& job, Time now);
    void charge(const JobRecord& job, Time now);
    JobRecord enter(Entry& entry, JobState state, Time now);
    void append_to(Entry& entry, std::span<const NewEvent> events);

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

/// A tenant's queued jobs run in this order, smaller first.
inline std::pair<int, std::int64_t> order_of(const JobRecord& job) {
    return {-job.priority, job.number};
}

}  // namespace remesh::testing
