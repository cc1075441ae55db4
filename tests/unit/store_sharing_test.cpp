// What every engine of the store must do for many jobs and tenants, and for listeners.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <thread>

#include "tests/unit/store_conformance.h"

namespace remesh::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;
using Verdict = Creation::Verdict;
using std::chrono::seconds;

TEST_P(JobStoreConformance, LetsTenantsTakeTurns) {
    for (const char* id : {"1", "2", "3"}) {
        create_for("a", id);
    }
    create_for("b", "4");
    create_for("b", "5");

    EXPECT_EQ(claim_tenants(5), "ababa");
}

TEST_P(JobStoreConformance, SharesWorkersByWeight) {
    store->set_policy("a", {.weight = 3});
    for (int i = 0; i < 8; ++i) {
        create_for("a", "a" + std::to_string(i));
        create_for("b", "b" + std::to_string(i));
    }

    const std::string claimed = claim_tenants(8);

    EXPECT_EQ(std::count(claimed.begin(), claimed.end(), 'a'), 6) << claimed;
}

TEST_P(JobStoreConformance, LetsATenantPayForTheTimeOfItsJobs) {
    create_for("a", "long");
    const auto job = claim_at(2);
    store->settle({job->key, job->epoch}, {JobState::Failed, "no", {}, {}}, at(7));
    for (int i = 0; i < 5; ++i) {
        create_for("a", "a" + std::to_string(i));
        create_for("b", "b" + std::to_string(i));
    }
    std::string claimed;
    for (int i = 0; i < 6; ++i) {
        const auto next = claim_at(8);
        claimed += next->key.tenant;
        store->settle({next->key, next->epoch}, {JobState::Failed, "no", {}, {}}, at(8));
    }

    EXPECT_EQ(claimed, "bbbbba");
}

TEST_P(JobStoreConformance, RunsNoMoreJobsOfATenantThanItMay) {
    create_for("a", "1");
    create_for("a", "2");
    create_for("b", "3");
    store->set_policy("a", {.weight = 1'000, .max_running = 1});

    EXPECT_EQ(claim_tenants(2), "ab");
    EXPECT_FALSE(claim_at(2));
    create_for("b", "4");
    EXPECT_FALSE(store->claim({"worker", 1}, at(2)));
}

TEST_P(JobStoreConformance, CountsTheJobsOfAllTenantsByState) {
    EXPECT_EQ(store->figures(), StoreFigures{});

    create_for("a", "runs");
    claim();
    store->create(job_named("waits"), {}, at(3));
    store->create(job_named("waits too"), {}, at(4));

    const StoreFigures figures = store->figures();
    EXPECT_THAT(figures.jobs, ElementsAre(Pair(JobState::Queued, 2), Pair(JobState::Running, 1)));
    EXPECT_EQ(figures.oldest_queued, at(3));
}

TEST_P(JobStoreConformance, CountsWhatEachTenantWaitsFor) {
    EXPECT_THAT(store->backlogs(), IsEmpty());

    create_for("b", "runs");
    store->request_cancel(claim().key, at(2));
    create_for("a", "waits");
    create_for("b", "waits too");
    create_for("c", "is over");
    store->request_cancel({"c", "is over"}, at(2));

    EXPECT_THAT(store->backlogs(),
                ElementsAre(TenantBacklog{"a", 1, 0, at(1)}, TenantBacklog{"b", 1, 1, at(1)}));
}

TEST_P(JobStoreConformance, RefusesWhatATenantMayNotQueueOrKeep) {
    store->set_policy("clinic", {.max_queued = 1, .max_bytes = 15});

    EXPECT_EQ(store->create(job_named("one"), {}, at(1)).verdict, Verdict::Created);
    const Creation second = store->create(job_named("two"), {}, at(1));
    EXPECT_EQ(second.verdict, Verdict::TenantQueueFull);
    EXPECT_EQ(second.limit, 1);
    EXPECT_FALSE(store->add_artifact("clinic", {kOutput, 6}, {}, at(1)));
    EXPECT_TRUE(store->add_artifact("clinic", {kOutput, 5}, {}, at(1)));
    EXPECT_TRUE(store->add_artifact("clinic", {kInput, 10}, {}, at(1))) << "it is there";
    EXPECT_EQ(store->stored_bytes("clinic"), 15);
    store->request_cancel({"clinic", "one"}, at(2));
    EXPECT_EQ(store->create(job_named("three"), {}, at(3)).verdict, Verdict::TenantBytesFull);
    EXPECT_FALSE(store->add_artifact("other", {kOutput, 5}, 4, at(1)));
    EXPECT_EQ(store->policy("clinic"), (TenantPolicy{.max_queued = 1, .max_bytes = 15}));
    EXPECT_EQ(store->policy("other"), TenantPolicy{});
}

TEST_P(JobStoreConformance, AnswersAJobByAnEqualOnesResult) {
    NewJob first = job_named("first");
    first.cache_key = "key";
    store->create(first, {}, at(1));
    store->settle(claim(), success(), at(3));
    NewJob again = job_named("again");
    again.cache_key = "key";
    again.may_reuse = true;
    NewJob anew = job_named("anew");
    anew.cache_key = "key";
    EXPECT_EQ(store->reusable_outputs("clinic", "key"), std::vector<std::string>{kOutput});
    EXPECT_TRUE(store->reusable_outputs("clinic", "other").empty());
    EXPECT_TRUE(store->reusable_outputs("other", "key").empty());

    const auto answered = store->create(again, {}, at(5)).job;
    const auto run = store->create(anew, {}, at(5)).job;
    std::vector<std::string> artifacts;
    store->remove({"clinic", "first"}, {}, &artifacts);

    EXPECT_EQ(answered->state, JobState::Succeeded);
    EXPECT_EQ(answered->outcome, "done");
    EXPECT_EQ(answered->origin, "first");
    EXPECT_EQ(answered->attempt, 0);
    EXPECT_EQ(store->find(answered->key), answered);
    EXPECT_EQ(run->state, JobState::Queued);
    EXPECT_FALSE(store->remove_artifact("clinic", kOutput)) << "the second job needs it";
    EXPECT_EQ(store->mean_run_time("clinic", 10), std::nullopt);
}

TEST_P(JobStoreConformance, TellsTheLastProgressOfThePresentAttempt) {
    create("one");
    const Claim first = claim();
    store->append(first,
                  std::vector<NewEvent>{{EventKind::Progress, at(3), "p"},
                                        {EventKind::Progress, at(3), "q"},
                                        {EventKind::Sample, at(3), "s"}},
                  {}, at(3));

    EXPECT_EQ(store->last_progress(first.key), "q");
    store->request_cancel(first.key, at(3));
    EXPECT_EQ(store->last_progress(first.key), "q");
    create("two");
    store->append(claim(), std::vector<NewEvent>{{EventKind::Progress, at(3), "r"}}, {}, at(3));
    store->lose({{"clinic", "two"}, 1}, lost(0), at(4));
    claim();
    EXPECT_EQ(store->last_progress({"clinic", "two"}), "");
}

TEST_P(JobStoreConformance, FindsWhatEndedLongAgoAndHowLongJobsTook) {
    for (const char* id : {"one", "two", "three"}) {
        create(id);
    }
    store->settle(claim(), success(), at(4));
    store->settle(claim(), success(), at(8));
    store->settle(claim(), {JobState::Failed, "no", {}, {}}, at(6));

    EXPECT_THAT(store->ended_before(at(8), 10),
                ElementsAre(JobKey{"clinic", "one"}, JobKey{"clinic", "three"}));
    EXPECT_THAT(store->ended_before(at(9), 1), ElementsAre(JobKey{"clinic", "one"}));
    EXPECT_EQ(store->mean_run_time("clinic", 10), seconds(4));
    EXPECT_EQ(store->mean_run_time("clinic", 1), seconds(6));
    EXPECT_EQ(store->mean_run_time("other", 10), std::nullopt);
}

TEST_P(JobStoreConformance, TellsEachListenerWhichJobsChanged) {
    create("before");
    const auto feed = store->follow();
    const auto other = store->follow();

    EXPECT_THAT(feed->next(std::chrono::milliseconds(0), {}), IsEmpty());
    create("one");
    const Claim held = claim();
    EXPECT_THAT(feed->next(seconds(10), {}),
                ::testing::UnorderedElementsAre(held.key, JobKey{"clinic", "one"}));
    store->append(held, std::vector<NewEvent>{{EventKind::Sample, at(3), "s"}}, {}, at(3));
    EXPECT_THAT(feed->next(seconds(10), {}), ElementsAre(held.key));
    EXPECT_THAT(feed->next(std::chrono::milliseconds(0), {}), IsEmpty());
    EXPECT_THAT(other->next(seconds(10), {}), SizeIs(2));
}

TEST_P(JobStoreConformance, WakesAListenerThatWaits) {
    const auto feed = store->follow();
    std::jthread writer([this] { create("one"); });

    EXPECT_THAT(feed->next(seconds(10), {}), ElementsAre(JobKey{"clinic", "one"}));
}

TEST_P(JobStoreConformance, LetsAListenerGoThatIsAskedToStop) {
    const auto feed = store->follow();
    std::jthread listener([&](const std::stop_token& stop) {
        EXPECT_THAT(feed->next(std::chrono::hours(1), stop), IsEmpty());
    });
}

}  // namespace
}  // namespace remesh::testing
