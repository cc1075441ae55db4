#pragma once

#include <filesystem>
#include <mutex>
#include <utility>

#include "server/store/bell.h"
#include "server/store/job_store.h"
#include "server/store/sqlite.h"
#include "server/store/sqlite_rows.h"

namespace remesh::sqlite {

/// The store in one SQLite file. One connection writes, another reads, so that reading never waits
/// for a disk. Its sources: sqlite_job_store.cpp (jobs), sqlite_attempts.cpp (what workers do),
/// sqlite_artifacts.cpp (artifacts, policies, changes).
class Store final : public JobStore {
public:
    explicit Store(const std::filesystem::path& file);

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
    /// The writing connection, alone and in a transaction that is rolled back unless committed.
    class Write {
    public:
        explicit Write(Store& store)
            : store_(store), lock_(store.writer_mutex_), transaction_(store.writer_) {}
        [[nodiscard]] Connection& connection() const { return store_.writer_; }
        void commit() { transaction_.commit(); }
        /// For what listeners want to know.
        void commit_and_ring() {
            transaction_.commit();
            store_.bell_.ring();
        }

    private:
        Store& store_;
        std::scoped_lock<std::mutex> lock_;
        Transaction transaction_;
    };
    class Feed;

    /// Runs `query` on the reading connection.
    template <typename Query>
    auto read(Query query) {
        const std::scoped_lock lock(reader_mutex_);
        return query(reader_);
    }
    /// Ends the claim's attempt: a Cancelling job becomes Cancelled, another one what
    /// `next(connection, job)` says, which may change the job on the way.
    template <typename Next>
    std::optional<JobRecord> end_attempt(const Claim& claim, Time now, Next next);

    std::filesystem::path directory_;

    std::mutex writer_mutex_;
    Connection writer_;  // needs writer_mutex_

    std::mutex reader_mutex_;
    Connection reader_;  // needs reader_mutex_

    Bell bell_;
};

}  // namespace remesh::sqlite
