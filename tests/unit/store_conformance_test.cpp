#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <thread>

#include "server/store/job_store.h"
#include "server/store/sqlite_job_store.h"
#include "tests/support/model_job_store.h"
#include "tests/support/temporary_directory.h"

// What every engine of the store must do.

namespace remesh {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::ModelJobStore;
using ::testing::Pair;
using ::testing::SizeIs;
using testing::TemporaryDirectory;
using Verdict = Creation::Verdict;
using std::chrono::seconds;

const std::string kInput(64, 'a');
const std::string kOutput(64, 'b');
const std::string kPreview(64, 'c');

Time at(int second) {
    return Time(std::chrono::seconds(second));
}

NewJob job_named(const std::string& id, int priority = 0) {
    return {{"clinic", id}, "", "spec of " + id, priority, 3, {kInput}, "", false, ""};
}

Loss lost(int second) {
    return {.last_state = JobState::Quarantined, .outcome = "lost", .retry_time = at(second)};
}

Settlement success() {
    return {JobState::Succeeded, "done", {}, {{kOutput, 5}}};
}

/// A new engine adds its way to open it below.
struct StoreEngine {
    std::string name;
    std::function<std::unique_ptr<JobStore>(const std::filesystem::path&)> open;
    bool is_durable = true;
};

class JobStoreConformance : public ::testing::TestWithParam<StoreEngine> {
protected:
    JobStoreConformance() { store->add_artifact("clinic", {kInput, 10}, {}, at(0)); }

    void reopen() {
        store.reset();
        store = GetParam().open(directory.path());
    }
    JobRecord create(const std::string& id, int priority = 0) {
        return *store->create(job_named(id, priority), {}, at(1)).job;
    }
    void create_for(const std::string& tenant, const std::string& id) {
        NewJob job = job_named(id);
        job.key.tenant = tenant;
        job.inputs.clear();
        store->create(job, {}, at(1));
    }
    std::optional<JobRecord> claim_at(int second) {
        return store->claim({"worker", std::nullopt}, at(second));
    }
    Claim claim() {
        const auto job = claim_at(2);
        return {job->key, job->epoch};
    }
    /// Tenants of the next `count` jobs that are claimed, one letter each.
    std::string claim_tenants(int count) {
        std::string tenants;
        for (int i = 0; i < count; ++i) {
            tenants += claim_at(2)->key.tenant;
        }
        return tenants;
    }
    JobState state(const std::string& id) { return store->find({"clinic", id})->state; }

    TemporaryDirectory directory;
    std::unique_ptr<JobStore> store = GetParam().open(directory.path());
};

TEST_P(JobStoreConformance, KeepsWhatWasCreatedOverAReopening) {
    if (!GetParam().is_durable) {
        GTEST_SKIP() << "keeps nothing by design";
    }
    const JobRecord created = create("one", 7);

    reopen();

    const auto job = store->find({"clinic", "one"});
    ASSERT_TRUE(job);
    EXPECT_EQ(job->spec, "spec of one");
    EXPECT_EQ(job->priority, 7);
    EXPECT_EQ(job->state, JobState::Queued);
    EXPECT_EQ(job->create_time, at(1));
    EXPECT_EQ(job->revision, created.revision);
    EXPECT_EQ(job->last_sequence, 1);
    EXPECT_FALSE(store->find({"other", "one"}));
}

TEST_P(JobStoreConformance, ReturnsTheFirstJobForARepeatedRequest) {
    NewJob job = job_named("one");
    job.request_id = "r";
    store->create(job, {}, at(1));
    NewJob again = job_named("two");
    again.request_id = "r";
    again.spec = job.spec;

    const Creation repeated = store->create(again, {}, at(2));
    again.spec = "another";
    const Creation conflict = store->create(again, {}, at(2));
    again.key.tenant = "other";
    again.inputs.clear();
    const Creation elsewhere = store->create(again, {}, at(2));

    EXPECT_EQ(repeated.verdict, Verdict::Repeated);
    EXPECT_EQ(repeated.job->key.id, "one");
    EXPECT_EQ(conflict.verdict, Verdict::Conflict);
    EXPECT_EQ(elsewhere.verdict, Verdict::Created);
}

TEST_P(JobStoreConformance, RefusesAJobWithoutItsInputOrBeyondTheQueue) {
    NewJob job = job_named("one");
    job.inputs = {kInput, kOutput};

    const Creation missing = store->create(job, {}, at(1));
    create("two");
    const Creation full = store->create(job_named("three"), {.max_queued = 1}, at(1));

    EXPECT_EQ(missing.verdict, Verdict::MissingInput);
    EXPECT_EQ(missing.missing, kOutput);
    EXPECT_EQ(full.verdict, Verdict::QueueFull);
    EXPECT_FALSE(store->find({"clinic", "three"}));
}

TEST_P(JobStoreConformance, HandsOutTheHighestPriorityThenTheOldest) {
    create("low", -5);
    create("first");
    create("second");
    const JobRecord high = create("high", 5);

    EXPECT_EQ(store->queue_position(high), 0);
    create_for("other", "theirs");
    EXPECT_EQ(store->queue_position(*store->find({"clinic", "second"})), 2);
    EXPECT_EQ(store->queue_position(*store->find({"other", "theirs"})), 0) << "counts its own";
    store->request_cancel({"other", "theirs"}, at(2));
    EXPECT_EQ(claim_at(2)->key.id, "high");
    EXPECT_EQ(claim_at(2)->key.id, "first");
    EXPECT_EQ(claim_at(2)->key.id, "second");
    EXPECT_EQ(claim_at(2)->key.id, "low");
    EXPECT_FALSE(claim_at(2));
}

TEST_P(JobStoreConformance, NumbersEventsWithoutGapsOverTheWholeLife) {
    create("one");
    const Claim held = claim();
    const std::vector<NewEvent> events{{EventKind::Progress, at(3), "p"},
                                       {EventKind::Sample, at(4), "s"}};
    const auto last = store->append(held, events, {}, at(4));
    store->settle(held, {JobState::Succeeded, "done", {{EventKind::Warning, at(5), "w"}}, {}},
                  at(6));

    const auto all = store->events_after(held.key, 0, 100);

    EXPECT_EQ(last, 4);
    ASSERT_THAT(all, SizeIs(6));
    for (std::size_t i = 0; i < all.size(); ++i) {
        EXPECT_EQ(all[i].sequence, static_cast<std::int64_t>(i) + 1);
    }
    EXPECT_EQ(all[0].state, JobState::Queued);
    EXPECT_EQ(all[1].state, JobState::Running);
    EXPECT_EQ(all[1].attempt, 1);
    EXPECT_EQ(all[2].payload, "p");
    EXPECT_EQ(all[4].kind, EventKind::Warning);
    EXPECT_EQ(all[5].state, JobState::Succeeded);
    EXPECT_THAT(store->events_after(held.key, 4, 1), SizeIs(1));
    EXPECT_EQ(store->events_after(held.key, 4, 1).front().sequence, 5);
}

TEST_P(JobStoreConformance, KeepsWhatAFailedJobMadeButNotACancelledOne) {
    create("first");
    const Claim failing = claim();
    store->settle(failing, {JobState::Failed, "no", {}, {{kOutput, 5}}}, at(4));
    EXPECT_EQ(store->find_artifact("clinic", kOutput), (ArtifactId{kOutput, 5}));
    EXPECT_FALSE(store->remove_artifact("clinic", kOutput)) << "the failed job refers to it";

    create("second");
    const Claim cancelled = claim();
    store->request_cancel(cancelled.key, at(5));
    store->settle(cancelled, {JobState::Failed, "no", {}, {{kPreview, 3}}}, at(6));
    EXPECT_FALSE(store->find_artifact("clinic", kPreview));
}

TEST_P(JobStoreConformance, SettlesOnceAndShowsOutputsWithIt) {
    create("one");
    const Claim held = claim();
    const Settlement success{JobState::Succeeded, "done", {}, {{kOutput, 5}}};

    const auto settled = store->settle(held, success, at(9));
    const auto again = store->settle(held, {JobState::Failed, "no", {}, {}}, at(10));

    EXPECT_EQ(settled->state, JobState::Succeeded);
    EXPECT_EQ(settled->end_time, at(9));
    EXPECT_EQ(settled->start_time, at(2));
    EXPECT_FALSE(again);
    EXPECT_EQ(store->find(held.key)->outcome, "done");
    EXPECT_EQ(store->find_artifact("clinic", kOutput), (ArtifactId{kOutput, 5}));
}

TEST_P(JobStoreConformance, ChangesNothingForAnOldClaim) {
    create("one");
    const Claim old = claim();
    store->lose(old, lost(0), at(3));
    const Claim present = claim();

    EXPECT_FALSE(
        store->append(old, std::vector<NewEvent>{{EventKind::Sample, at(4), "s"}}, {}, at(4)));
    EXPECT_FALSE(store->settle(old, {JobState::Succeeded, "stale", {}, {{kOutput, 5}}}, at(4)));
    EXPECT_FALSE(store->give_back(old, at(4)));
    EXPECT_FALSE(store->lose(old, lost(0), at(4)));
    EXPECT_EQ(state("one"), JobState::Running);
    EXPECT_FALSE(store->find_artifact("clinic", kOutput));
    EXPECT_TRUE(store->settle(present, {JobState::Succeeded, "done", {}, {}}, at(5)));
}

TEST_P(JobStoreConformance, DoesNotCountAnAttemptThatWasGivenBack) {
    create("one");

    const auto job = store->give_back(claim(), at(3));

    EXPECT_EQ(job->state, JobState::Queued);
    EXPECT_EQ(job->attempt, 0);
    EXPECT_EQ(claim_at(4)->attempt, 1);
}

TEST_P(JobStoreConformance, QuarantinesAJobThatLostAllItsAttempts) {
    create("one");

    EXPECT_EQ(store->lose(claim(), lost(0), at(3))->state, JobState::Queued);
    EXPECT_EQ(store->lose(claim(), lost(0), at(3))->state, JobState::Queued);
    const auto job = store->lose(claim(), lost(0), at(3));

    EXPECT_EQ(job->state, JobState::Quarantined);
    EXPECT_EQ(job->outcome, "lost");
    EXPECT_FALSE(claim_at(4));
}

TEST_P(JobStoreConformance, CancelsQueuedJobsAtOnceAndRunningOnesWhenTheyEnd) {
    create("running");
    const Claim held = claim();
    create("queued");

    EXPECT_EQ(store->request_cancel({"clinic", "queued"}, at(3))->state, JobState::Cancelled);
    EXPECT_EQ(store->request_cancel({"clinic", "running"}, at(3))->state, JobState::Cancelling);
    const auto repeated = store->request_cancel({"clinic", "running"}, at(4));
    const auto ended =
        store->settle(held, {JobState::Succeeded, "done", {}, {{kOutput, 5}}}, at(5));

    EXPECT_EQ(repeated->last_sequence, 3);
    EXPECT_EQ(ended->state, JobState::Cancelled);
    EXPECT_EQ(ended->outcome, "");
    EXPECT_FALSE(store->find_artifact("clinic", kOutput));
    EXPECT_EQ(store->request_cancel({"clinic", "running"}, at(6))->state, JobState::Cancelled);
    EXPECT_FALSE(store->request_cancel({"clinic", "none"}, at(6)));
}

TEST_P(JobStoreConformance, EndsACancellingJobWhoseWorkerIsGone) {
    create("one");
    const Claim held = claim();
    store->request_cancel(held.key, at(3));

    EXPECT_THAT(store->held(), SizeIs(1));
    EXPECT_EQ(store->lose(held, lost(0), at(4))->state, JobState::Cancelled);
    EXPECT_THAT(store->held(), IsEmpty());
}

TEST_P(JobStoreConformance, ListsNewestFirstByPageAndState) {
    create("one");
    create("two");
    create("three");
    store->request_cancel({"clinic", "two"}, at(3));

    const auto page = store->list({"clinic", {}, {}, 2});
    const auto rest = store->list({"clinic", {}, page.back().number, 2});
    const auto queued = store->list({"clinic", {JobState::Queued}, {}, 10});

    ASSERT_THAT(page, SizeIs(2));
    EXPECT_EQ(page[0].key.id, "three");
    EXPECT_EQ(page[1].key.id, "two");
    ASSERT_THAT(rest, SizeIs(1));
    EXPECT_EQ(rest[0].key.id, "one");
    EXPECT_THAT(queued, SizeIs(2));
    EXPECT_THAT(store->list({"other", {}, {}, 10}), IsEmpty());
}

TEST_P(JobStoreConformance, RemovesOnlyTerminalJobsOfTheExpectedRevision) {
    const JobRecord created = create("one");
    std::vector<std::string> artifacts;

    EXPECT_EQ(store->remove(created.key, {}, &artifacts), JobStore::Removal::NotTerminal);
    const auto cancelled = store->request_cancel(created.key, at(3));
    EXPECT_EQ(store->remove(created.key, created.revision, &artifacts),
              JobStore::Removal::OtherRevision);
    EXPECT_EQ(store->remove(created.key, cancelled->revision, &artifacts),
              JobStore::Removal::Removed);
    EXPECT_EQ(store->remove(created.key, {}, &artifacts), JobStore::Removal::NotFound);

    EXPECT_THAT(artifacts, ElementsAre(kInput));
    EXPECT_THAT(store->events_after(created.key, 0, 10), IsEmpty());
}

TEST_P(JobStoreConformance, KeepsAnArtifactAsLongAsAJobNeedsIt) {
    create("one");
    create("two");
    std::vector<std::string> artifacts;
    for (const char* id : {"one", "two"}) {
        EXPECT_FALSE(store->remove_artifact("clinic", kInput)) << "before removing " << id;
        store->request_cancel({"clinic", id}, at(3));
        store->remove({"clinic", id}, {}, &artifacts);
    }

    EXPECT_THAT(store->unreferenced_artifacts(at(0)), IsEmpty());
    EXPECT_THAT(store->unreferenced_artifacts(at(1)), SizeIs(1));
    EXPECT_TRUE(store->remove_artifact("clinic", kInput));
    EXPECT_FALSE(store->find_artifact("clinic", kInput));
}

TEST_P(JobStoreConformance, DropsThePreviewsThatNobodyKeeps) {
    create("one");
    const Claim held = claim();
    store->append(held, std::vector<NewEvent>{{EventKind::Preview, at(3), "v"}},
                  std::vector<ArtifactId>{{kPreview, 3}, {kOutput, 3}}, at(3));

    EXPECT_THAT(store->drop_previews(held.key, std::vector{kPreview}), ElementsAre(kOutput));
    EXPECT_FALSE(store->remove_artifact("clinic", kPreview));
    EXPECT_TRUE(store->remove_artifact("clinic", kOutput));
}

TEST_P(JobStoreConformance, WaitsBeforeItTriesALostJobAgain) {
    create("one");
    store->lose(claim(), lost(10), at(3));

    EXPECT_EQ(store->find({"clinic", "one"})->retry_time, at(10));
    EXPECT_FALSE(claim_at(9));
    EXPECT_TRUE(claim_at(10));
    EXPECT_FALSE(store->find({"clinic", "one"})->retry_time);
}

TEST_P(JobStoreConformance, QuarantinesAJobThatCrashedItsWorkerTwice) {
    create("one");
    Loss crash = lost(0);
    crash.is_crash = true;

    EXPECT_EQ(store->lose(claim(), lost(0), at(3))->state, JobState::Queued);
    EXPECT_EQ(store->lose(claim(), crash, at(3))->state, JobState::Queued);
    const auto job = store->lose(claim(), crash, at(3));

    EXPECT_EQ(job->state, JobState::Quarantined);
    EXPECT_EQ(job->crashes, 2);
}

TEST_P(JobStoreConformance, KeepsAJobWhoseWorkerHasBeatenSinceItWasLookedAt) {
    create("one");
    const Claim held = claim();
    Loss loss = lost(0);
    loss.seen_beat = store->held().front().beat;

    EXPECT_EQ(store->renew(held), JobState::Running);
    EXPECT_FALSE(store->lose(held, loss, at(3)));
    loss.seen_beat = store->held().front().beat;
    EXPECT_EQ(store->lose(held, loss, at(3))->state, JobState::Queued);
    EXPECT_FALSE(store->renew(held));
}

TEST_P(JobStoreConformance, NamesTheWorkerAsLongAsItHoldsTheJob) {
    create("one");
    const Claim held = claim();

    EXPECT_EQ(store->find(held.key)->worker, "worker");
    store->request_cancel(held.key, at(3));
    EXPECT_EQ(store->find(held.key)->worker, "worker");
    EXPECT_EQ(store->renew(held), JobState::Cancelling);
    EXPECT_EQ(store->give_back(held, at(4))->worker, "");
}

TEST_P(JobStoreConformance, NeverLetsTimesOfAJobGoBack) {
    store->create(job_named("one"), {}, at(100));

    const auto running = claim_at(50);
    const auto ended = store->settle({running->key, running->epoch}, success(), at(10));

    EXPECT_EQ(running->start_time, at(100));
    EXPECT_EQ(ended->end_time, at(100));
    EXPECT_EQ(store->find(ended->key), ended);
}

TEST_P(JobStoreConformance, DoesNotWaitForARetryTimeThatOnlyAJumpOfTheClockExplains) {
    create("one");
    store->lose(claim(), lost(100'000), at(99'990));

    EXPECT_FALSE(claim_at(99'999));
    EXPECT_TRUE(claim_at(5)) << "the clock went back by a day";
}

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
    EXPECT_THAT(store->ended_since(std::nullopt, at(6), 10),
                ElementsAre(JobKey{"clinic", "two"}, JobKey{"clinic", "three"}));
    EXPECT_THAT(store->ended_since("clinic", at(4), 1), ElementsAre(JobKey{"clinic", "two"}));
    EXPECT_THAT(store->ended_since("other", at(4), 10), IsEmpty());
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

INSTANTIATE_TEST_SUITE_P(Engines, JobStoreConformance,
                         ::testing::Values(StoreEngine{"Sqlite",
                                                       [](const std::filesystem::path& directory) {
                                                           return open_sqlite_store(directory /
                                                                                    "store.sqlite");
                                                       }},
                                           StoreEngine{"Model",
                                                       [](const std::filesystem::path&) {
                                                           return std::make_unique<ModelJobStore>();
                                                       },
                                                       false}),
                         [](const auto& engine) { return engine.param.name; });

}  // namespace
}  // namespace remesh
