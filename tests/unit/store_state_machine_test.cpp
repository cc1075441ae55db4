#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "server/store/digest.h"
#include "server/store/sqlite_job_store.h"
#include "tests/support/model_job_store.h"
#include "tests/support/temporary_directory.h"

// Random operations on the SQLite store and the model at once: they must agree on every answer and
// on everything that can be seen afterwards.

namespace remesh {
namespace {

using testing::ModelJobStore;
using testing::TemporaryDirectory;

/// Both stores, a clock that sometimes jumps, and what a client and its workers know.
class Twins {
public:
    Twins(const std::filesystem::path& directory, std::uint64_t seed)
        : file_(directory / "store.sqlite"), store_(open_sqlite_store(file_)), random_(seed) {}

    void step() {
        now_ += std::chrono::milliseconds(below(3'000));
        if (below(50) == 0) {
            now_ += std::chrono::hours(below(100)) - std::chrono::hours(50);
        }
        switch (below(16)) {
            case 0:
            case 1:
            case 2: create(); break;
            case 3: add_artifact(); break;
            case 4:
            case 5:
            case 6: claim(); break;
            case 7: append(); break;
            case 8:
            case 9: settle(); break;
            case 10: give_back(); break;
            case 11: lose(); break;
            case 12: cancel(); break;
            case 13: remove(); break;
            case 14: below(2) == 0 ? set_policy() : drop(); break;
            default: below(5) == 0 ? reopen() : renew(); break;
        }
    }

    void compare_everything() {
        for (const char* tenant : {"a", "b", "c"}) {
            const ListQuery all{tenant, {}, {}, 1'000};
            const auto jobs = store_->list(all);
            ASSERT_EQ(jobs, model_.list(all));
            for (const JobRecord& job : jobs) {
                ASSERT_EQ(store_->events_after(job.key, 0, 1'000),
                          model_.events_after(job.key, 0, 1'000));
                ASSERT_EQ(store_->queue_position(job), model_.queue_position(job));
                ASSERT_EQ(store_->last_progress(job.key), model_.last_progress(job.key));
            }
            ASSERT_EQ(store_->stored_bytes(tenant), model_.stored_bytes(tenant));
        }
        ASSERT_EQ(store_->held(), model_.held());
        ASSERT_EQ(store_->unreferenced_artifacts(now_), model_.unreferenced_artifacts(now_));
        ASSERT_EQ(store_->ended_before(now_, 5), model_.ended_before(now_, 5));
        for (const auto& tenant : {std::optional<std::string>(), std::optional<std::string>("b")}) {
            ASSERT_EQ(store_->ended_since(tenant, now_ - std::chrono::hours(1), 5),
                      model_.ended_since(tenant, now_ - std::chrono::hours(1), 5));
        }
        ASSERT_EQ(store_->backlogs(), model_.backlogs());
        ASSERT_EQ(store_->mean_run_time("a", 7), model_.mean_run_time("a", 7));
        ASSERT_EQ(store_->figures(), model_.figures());
    }

    /// Whether each job has exactly one terminal event if it is terminal, as its last one.
    void check_ends() {
        for (const char* tenant : {"a", "b", "c"}) {
            for (const JobRecord& job : store_->list({tenant, {}, {}, 1'000})) {
                const auto events = store_->events_after(job.key, 0, 1'000);
                const auto ends =
                    std::count_if(events.begin(), events.end(), [](const StoredEvent& event) {
                        return event.kind == EventKind::State && is_terminal(event.state);
                    });
                ASSERT_EQ(ends, is_terminal(job.state) ? 1 : 0);
                ASSERT_EQ(static_cast<std::int64_t>(events.size()), events.back().sequence);
            }
        }
    }

private:
    int below(int end) { return static_cast<int>(random_() % static_cast<std::uint64_t>(end)); }
    std::string tenant() { return std::string(1, static_cast<char>('a' + below(3))); }
    std::string digest() { return sha256_of(std::to_string(below(12))); }
    ArtifactId artifact() {
        const int size = below(12);
        return {sha256_of(std::to_string(size)), size};
    }
    JobKey job() {
        return below(20) == 0 || keys_.empty()
                   ? JobKey{tenant(), "unknown"}
                   : keys_[static_cast<std::size_t>(below(static_cast<int>(keys_.size())))];
    }
    /// One that was handed out before, often void by now.
    Claim old_claim() {
        return claims_.empty() || below(20) == 0
                   ? Claim{job(), 1}
                   : claims_[claims_.size() - 1 -
                             static_cast<std::size_t>(below(
                                 static_cast<int>(std::min<std::size_t>(claims_.size(), 8))))];
    }
    std::vector<NewEvent> events() {
        std::vector<NewEvent> some;
        for (int i = below(4); i > 0; --i) {
            some.push_back({below(2) == 0 ? EventKind::Progress : EventKind::Sample, now_,
                            std::to_string(random_())});
        }
        return some;
    }

    void create() {
        NewJob job{{tenant(), std::to_string(++last_id_)}, {}, std::to_string(below(3))};
        job.priority = below(3) - 1;
        job.max_attempts = 1 + below(4);
        if (below(3) == 0) {
            job.request_id = std::to_string(below(8));
        }
        if (below(4) != 0) {
            job.inputs = {digest()};
        }
        if (below(2) == 0) {
            job.cache_key = std::to_string(below(6));
            job.may_reuse = below(2) == 0;
        }
        QueueLimits limits{.max_queued = 12, .max_queued_of_tenant = 6};
        limits.max_bytes_of_tenant = 60;
        const Creation real = store_->create(job, limits, now_);
        const Creation modelled = model_.create(job, limits, now_);
        ASSERT_EQ(real.verdict, modelled.verdict);
        ASSERT_EQ(real.job, modelled.job);
        ASSERT_EQ(real.missing, modelled.missing);
        ASSERT_EQ(real.limit, modelled.limit);
        if (real.verdict == Creation::Verdict::Created) {
            keys_.push_back(job.key);
        }
    }
    void add_artifact() {
        const std::string owner = tenant();
        const ArtifactId added = artifact();
        ASSERT_EQ(store_->add_artifact(owner, added, 70, now_),
                  model_.add_artifact(owner, added, 70, now_));
    }
    void claim() {
        const ClaimRequest request{"worker " + std::to_string(below(3)),
                                   below(2) == 0 ? std::optional<std::int64_t>(3) : std::nullopt};
        const auto real = store_->claim(request, now_);
        ASSERT_EQ(real, model_.claim(request, now_));
        if (real) {
            claims_.push_back({real->key, real->epoch});
        }
    }
    void renew() {
        const Claim held = old_claim();
        ASSERT_EQ(store_->renew(held), model_.renew(held));
    }
    void append() {
        const Claim held = old_claim();
        const auto some = events();
        std::vector<ArtifactId> previews;
        if (below(3) == 0) {
            previews.push_back(artifact());
        }
        ASSERT_EQ(store_->append(held, some, previews, now_),
                  model_.append(held, some, previews, now_));
    }
    void settle() {
        const Claim held = old_claim();
        const Settlement end{below(4) == 0 ? JobState::Failed : JobState::Succeeded,
                             std::to_string(random_()),
                             events(),
                             {artifact(), artifact()}};
        ASSERT_EQ(store_->settle(held, end, now_), model_.settle(held, end, now_));
    }
    void give_back() {
        const Claim held = old_claim();
        ASSERT_EQ(store_->give_back(held, now_), model_.give_back(held, now_));
    }
    void lose() {
        const Claim held = old_claim();
        Loss loss{.is_crash = below(2) == 0, .outcome = "lost"};
        loss.last_state = below(2) == 0 ? JobState::Quarantined : JobState::Failed;
        loss.retry_time = now_ + std::chrono::seconds(below(20));
        if (below(3) == 0) {
            loss.seen_beat = below(2);
        }
        ASSERT_EQ(store_->lose(held, loss, now_), model_.lose(held, loss, now_));
    }
    void cancel() {
        const JobKey key = job();
        ASSERT_EQ(store_->request_cancel(key, now_), model_.request_cancel(key, now_));
    }
    void remove() {
        const JobKey key = job();
        const auto revision = below(3) == 0 ? std::optional<std::int64_t>(below(5)) : std::nullopt;
        std::vector<std::string> real;
        std::vector<std::string> modelled;
        ASSERT_EQ(store_->remove(key, revision, &real), model_.remove(key, revision, &modelled));
        ASSERT_EQ(real, modelled);
        for (const std::string& sha256 : real) {
            ASSERT_EQ(store_->remove_artifact(key.tenant, sha256),
                      model_.remove_artifact(key.tenant, sha256));
        }
    }
    void drop() {
        const JobKey key = job();
        const std::vector<std::string> keep{digest()};
        ASSERT_EQ(store_->drop_previews(key, keep), model_.drop_previews(key, keep));
    }
    void set_policy() {
        const std::string owner = tenant();
        TenantPolicy policy{.weight = 1 + below(5)};
        if (below(2) == 0) {
            policy.max_running = below(3);
            policy.max_queued = below(6);
        }
        store_->set_policy(owner, policy);
        model_.set_policy(owner, policy);
        ASSERT_EQ(store_->policy(owner), model_.policy(owner));
    }
    void reopen() {
        store_.reset();
        store_ = open_sqlite_store(file_);
    }

    std::filesystem::path file_;
    std::unique_ptr<JobStore> store_;
    ModelJobStore model_;
    std::mt19937_64 random_;
    Time now_ = Time(std::chrono::hours(10'000));
    int last_id_ = 0;
    std::vector<JobKey> keys_;
    std::vector<Claim> claims_;
};

class StoreStateMachine : public ::testing::TestWithParam<int> {};

TEST_P(StoreStateMachine, AgreesWithTheModelOnRandomOperations) {
    const TemporaryDirectory directory;
    Twins twins(directory.path(), static_cast<std::uint64_t>(GetParam()));
    for (int i = 0; i < 400; ++i) {
        twins.step();
        if (HasFatalFailure()) {
            FAIL() << "at step " << i;
        }
        if (i % 20 == 0) {
            twins.compare_everything();
        }
    }
    twins.compare_everything();
    twins.check_ends();
}

INSTANTIATE_TEST_SUITE_P(Seeds, StoreStateMachine, ::testing::Range(1, 9));

}  // namespace
}  // namespace remesh
