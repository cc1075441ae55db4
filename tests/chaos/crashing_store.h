#pragma once

#include <atomic>
#include <csignal>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include "server/store/job_store.h"

namespace remesh::testing {

/// A store whose process is killed, as by kill -9, right before or right after its nth commit.
class CrashingStore final : public JobStore {
private:
    template <typename Step>
    auto commit(Step step) {
        pass_point();
        auto result = step();
        pass_point();
        return result;
    }
    void pass_point() {
        if (++points_ == crash_at_) {
            ::kill(::getpid(), SIGKILL);
        }
    }

public:
    /// \param crash_at  counted from 1, two to a commit; 0: never
    CrashingStore(JobStore& store, int crash_at) : store_(store), crash_at_(crash_at) {}

    Creation create(const NewJob& job, const QueueLimits& limits, Time now) override {
        return commit([&] { return store_.create(job, limits, now); });
    }
    std::optional<JobRecord> claim(const ClaimRequest& request, Time now) override {
        return commit([&] { return store_.claim(request, now); });
    }
    std::optional<JobState> renew(const Claim& claim) override {
        return commit([&] { return store_.renew(claim); });
    }
    std::optional<std::int64_t> append(const Claim& claim, std::span<const NewEvent> events,
                                       std::span<const ArtifactId> previews, Time now) override {
        return commit([&] { return store_.append(claim, events, previews, now); });
    }
    std::optional<JobRecord> settle(const Claim& claim, const Settlement& settlement,
                                    Time now) override {
        return commit([&] { return store_.settle(claim, settlement, now); });
    }
    std::optional<JobRecord> give_back(const Claim& claim, Time now) override {
        return commit([&] { return store_.give_back(claim, now); });
    }
    std::optional<JobRecord> lose(const Claim& claim, const Loss& loss, Time now) override {
        return commit([&] { return store_.lose(claim, loss, now); });
    }
    std::optional<JobRecord> request_cancel(const JobKey& key, Time now) override {
        return commit([&] { return store_.request_cancel(key, now); });
    }
    Removal remove(const JobKey& key, std::optional<std::int64_t> revision,
                   std::vector<std::string>* artifacts) override {
        return commit([&] { return store_.remove(key, revision, artifacts); });
    }
    bool add_artifact(const std::string& tenant, const ArtifactId& artifact,
                      std::optional<std::int64_t> max_bytes, Time now) override {
        return commit([&] { return store_.add_artifact(tenant, artifact, max_bytes, now); });
    }
    std::vector<std::string> drop_previews(const JobKey& key,
                                           std::span<const std::string> keep) override {
        return commit([&] { return store_.drop_previews(key, keep); });
    }
    bool remove_artifact(const std::string& tenant, const std::string& sha256) override {
        return commit([&] { return store_.remove_artifact(tenant, sha256); });
    }
    void set_policy(const std::string& tenant, const TenantPolicy& policy) override {
        store_.set_policy(tenant, policy);
    }

    std::optional<JobRecord> find(const JobKey& key) override { return store_.find(key); }
    std::vector<std::string> reusable_outputs(const std::string& tenant,
                                              const std::string& cache_key) override {
        return store_.reusable_outputs(tenant, cache_key);
    }
    std::vector<JobRecord> list(const ListQuery& query) override { return store_.list(query); }
    std::int64_t queue_position(const JobRecord& job) override {
        return store_.queue_position(job);
    }
    std::vector<StoredEvent> events_after(const JobKey& key, std::int64_t sequence,
                                          std::size_t limit) override {
        return store_.events_after(key, sequence, limit);
    }
    std::string last_progress(const JobKey& key) override { return store_.last_progress(key); }
    std::unique_ptr<ChangeFeed> follow() override { return store_.follow(); }
    std::vector<JobRecord> held() override { return store_.held(); }
    std::vector<JobKey> ended_before(Time time, std::size_t limit) override {
        return store_.ended_before(time, limit);
    }
    std::vector<JobKey> ended_since(const std::optional<std::string>& tenant, Time time,
                                    std::size_t limit) override {
        return store_.ended_since(tenant, time, limit);
    }
    std::optional<std::chrono::microseconds> mean_run_time(const std::string& tenant,
                                                           std::size_t count) override {
        return store_.mean_run_time(tenant, count);
    }
    std::optional<ArtifactId> find_artifact(const std::string& tenant,
                                            const std::string& sha256) override {
        return store_.find_artifact(tenant, sha256);
    }
    std::vector<JobKey> unreferenced_artifacts(Time before) override {
        return store_.unreferenced_artifacts(before);
    }
    StoreFigures figures() override { return store_.figures(); }
    std::vector<TenantBacklog> backlogs() override { return store_.backlogs(); }
    std::int64_t stored_bytes(const std::string& tenant) override {
        return store_.stored_bytes(tenant);
    }
    TenantPolicy policy(const std::string& tenant) override { return store_.policy(tenant); }

private:
    JobStore& store_;
    const int crash_at_;
    std::atomic<int> points_ = 0;
};

}  // namespace remesh::testing
