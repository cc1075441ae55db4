#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <memory>

#include "server/store/artifact_store.h"
#include "server/store/data_dir.h"
#include "server/store/digest.h"
#include "server/store/job_store.h"
#include "server/store/sqlite_job_store.h"
#include "tests/support/temporary_directory.h"

namespace remesh {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using testing::TemporaryDirectory;
using Verdict = Creation::Verdict;

const std::string kInput(64, 'a');
const std::string kOutput(64, 'b');
const std::string kPreview(64, 'c');

Time at(int second) {
    return Time(std::chrono::seconds(second));
}

NewJob job_named(const std::string& id, int priority = 0) {
    return {{"clinic", id}, "", "spec of " + id, priority, 3, {kInput}};
}

/// What every engine of the store must do. A new engine adds its way to open it below.
struct StoreEngine {
    std::string name;
    std::function<std::unique_ptr<JobStore>(const std::filesystem::path&)> open;
};

class JobStoreConformance : public ::testing::TestWithParam<StoreEngine> {
protected:
    JobStoreConformance() { store->add_artifact("clinic", {kInput, 10}, at(0)); }

    void reopen() {
        store.reset();
        store = GetParam().open(directory.path());
    }
    JobRecord create(const std::string& id, int priority = 0) {
        return *store->create(job_named(id, priority), 100, at(1)).job;
    }
    Claim claim() {
        const auto job = store->claim(at(2));
        return {job->key, job->epoch};
    }
    JobState state(const std::string& id) { return store->find({"clinic", id})->state; }

    TemporaryDirectory directory;
    std::unique_ptr<JobStore> store = GetParam().open(directory.path());
};

TEST_P(JobStoreConformance, KeepsWhatWasCreatedOverAReopening) {
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
    store->create(job, 100, at(1));
    NewJob again = job_named("two");
    again.request_id = "r";
    again.spec = job.spec;

    const Creation repeated = store->create(again, 100, at(2));
    again.spec = "another";
    const Creation conflict = store->create(again, 100, at(2));
    again.key.tenant = "other";
    again.inputs.clear();
    const Creation elsewhere = store->create(again, 100, at(2));

    EXPECT_EQ(repeated.verdict, Verdict::Repeated);
    EXPECT_EQ(repeated.job->key.id, "one");
    EXPECT_EQ(conflict.verdict, Verdict::Conflict);
    EXPECT_EQ(elsewhere.verdict, Verdict::Created);
}

TEST_P(JobStoreConformance, RefusesAJobWithoutItsInputOrBeyondTheQueue) {
    NewJob job = job_named("one");
    job.inputs = {kInput, kOutput};

    const Creation missing = store->create(job, 100, at(1));
    create("two");
    const Creation full = store->create(job_named("three"), 1, at(1));

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
    EXPECT_EQ(store->queue_position(*store->find({"clinic", "second"})), 2);
    EXPECT_EQ(store->claim(at(2))->key.id, "high");
    EXPECT_EQ(store->claim(at(2))->key.id, "first");
    EXPECT_EQ(store->claim(at(2))->key.id, "second");
    EXPECT_EQ(store->claim(at(2))->key.id, "low");
    EXPECT_FALSE(store->claim(at(2)));
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
    store->lose(old, "lost", at(3));
    const Claim present = claim();

    EXPECT_FALSE(
        store->append(old, std::vector<NewEvent>{{EventKind::Sample, at(4), "s"}}, {}, at(4)));
    EXPECT_FALSE(store->settle(old, {JobState::Succeeded, "stale", {}, {{kOutput, 5}}}, at(4)));
    EXPECT_FALSE(store->give_back(old, at(4)));
    EXPECT_FALSE(store->lose(old, "lost", at(4)));
    EXPECT_EQ(state("one"), JobState::Running);
    EXPECT_FALSE(store->find_artifact("clinic", kOutput));
    EXPECT_TRUE(store->settle(present, {JobState::Succeeded, "done", {}, {}}, at(5)));
}

TEST_P(JobStoreConformance, DoesNotCountAnAttemptThatWasGivenBack) {
    create("one");

    const auto job = store->give_back(claim(), at(3));

    EXPECT_EQ(job->state, JobState::Queued);
    EXPECT_EQ(job->attempt, 0);
    EXPECT_EQ(store->claim(at(4))->attempt, 1);
}

TEST_P(JobStoreConformance, QuarantinesAJobThatLostAllItsAttempts) {
    create("one");

    EXPECT_EQ(store->lose(claim(), "lost", at(3))->state, JobState::Queued);
    EXPECT_EQ(store->lose(claim(), "lost", at(3))->state, JobState::Queued);
    const auto job = store->lose(claim(), "lost", at(3));

    EXPECT_EQ(job->state, JobState::Quarantined);
    EXPECT_EQ(job->outcome, "lost");
    EXPECT_FALSE(store->claim(at(4)));
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

    EXPECT_THAT(store->unsettled(), SizeIs(1));
    EXPECT_EQ(store->lose(held, "lost", at(4))->state, JobState::Cancelled);
    EXPECT_THAT(store->unsettled(), IsEmpty());
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

INSTANTIATE_TEST_SUITE_P(Engines, JobStoreConformance,
                         ::testing::Values(StoreEngine{"Sqlite",
                                                       [](const std::filesystem::path& directory) {
                                                           return open_sqlite_store(directory /
                                                                                    "store.sqlite");
                                                       }}),
                         [](const auto& engine) { return engine.param.name; });

TEST(SqliteJobStore, RefusesAFileThatIsNoDatabase) {
    const TemporaryDirectory directory;
    const auto file = directory.path() / "store.sqlite";
    std::ofstream(file) << std::string(10'000, 'x');

    EXPECT_THROW((void)open_sqlite_store(file), StoreError);
    EXPECT_EQ(std::filesystem::file_size(file), 10'000U);
}

TEST(DataDir, IsForOneServerAtATime) {
    const TemporaryDirectory directory;
    {
        const DataDir first(directory.path() / "data");
        EXPECT_THROW(DataDir(directory.path() / "data"), StoreError);
    }
    EXPECT_NO_THROW(DataDir(directory.path() / "data"));
}

TEST(Sha256, GivesTheDigestsOfTheStandard) {
    EXPECT_EQ(sha256_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    EXPECT_TRUE(is_sha256(sha256_of("")));
    EXPECT_FALSE(is_sha256(std::string(64, 'A')));
}

class ArtifactStoreTest : public ::testing::Test {
protected:
    ArtifactDraft draft_of(const std::string& bytes) {
        ArtifactDraft draft = artifacts.draft("clinic");
        draft.write(bytes);
        draft.finish();
        return draft;
    }
    std::filesystem::path path_of(const std::string& bytes) {
        return directory.path() / "tenants/clinic/artifacts" / sha256_of(bytes);
    }

    TemporaryDirectory directory;
    std::unique_ptr<JobStore> store = open_sqlite_store(directory.path() / "store.sqlite");
    ArtifactStore artifacts{directory.path(), *store};
};

TEST_F(ArtifactStoreTest, KeepsBytesUnderTheirDigestForTheOwnerAlone) {
    artifacts.add(draft_of("hello"), at(1));

    const auto artifact = artifacts.find("clinic", sha256_of("hello"));

    ASSERT_TRUE(artifact);
    EXPECT_EQ(artifacts.open("clinic", *artifact).bytes(), "hello");
    EXPECT_FALSE(artifacts.find("other", sha256_of("hello")));
    EXPECT_EQ(std::filesystem::status(path_of("hello")).permissions(),
              std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
}

TEST_F(ArtifactStoreTest, LeavesNothingOfADraftThatWasGivenUp) {
    { const auto draft = draft_of("hello"); }

    EXPECT_TRUE(std::filesystem::is_empty(directory.path() / "tenants/clinic/artifacts"));
}

TEST_F(ArtifactStoreTest, TakesBackFilesThatDidNotComeOnRecord) {
    std::vector<ArtifactDraft> drafts;
    drafts.push_back(draft_of("hello"));

    artifacts.publish(std::move(drafts), [] {});

    EXPECT_FALSE(std::filesystem::exists(path_of("hello")));
}

TEST_F(ArtifactStoreTest, NoticesAFileOfAnotherSize) {
    artifacts.add(draft_of("hello"), at(1));
    std::filesystem::resize_file(path_of("hello"), 3);

    EXPECT_THROW((void)artifacts.open("clinic", {sha256_of("hello"), 5}), StoreError);
}

TEST_F(ArtifactStoreTest, CollectsStraysAndWhatNobodyEverNeeded) {
    artifacts.add(draft_of("old"), at(1));
    artifacts.add(draft_of("new"), at(9));
    std::ofstream(path_of("stray")) << "stray";
    std::ofstream(path_of("stray").replace_filename(".draft-1")) << "half";

    artifacts.collect_garbage(at(5));

    EXPECT_FALSE(std::filesystem::exists(path_of("old")));
    EXPECT_FALSE(artifacts.find("clinic", sha256_of("old")));
    EXPECT_FALSE(std::filesystem::exists(path_of("stray")));
    EXPECT_FALSE(std::filesystem::exists(path_of("stray").replace_filename(".draft-1")));
    EXPECT_TRUE(std::filesystem::exists(path_of("new")));
}

}  // namespace
}  // namespace remesh
