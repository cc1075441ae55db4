#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <unistd.h>

#include "server/store/artifact_store.h"
#include "server/store/checkpoint_files.h"
#include "server/store/data_dir.h"
#include "server/store/digest.h"
#include "server/store/job_store.h"
#include "server/store/sqlite.h"
#include "server/store/sqlite_job_store.h"
#include "server/store/worker_roster.h"
#include "tests/support/full_disk.h"
#include "tests/support/temporary_directory.h"

namespace remesh {
namespace {

using testing::FullDisk;
using testing::TemporaryDirectory;

Time at(int second) {
    return Time(std::chrono::seconds(second));
}

std::string bytes_of(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

/// A file with jobs, as big as some pages.
std::filesystem::path make_store(const TemporaryDirectory& directory) {
    const auto file = directory.path() / "store.sqlite";
    const auto store = open_sqlite_store(file);
    for (int i = 0; i < 50; ++i) {
        store->create({{"clinic", std::to_string(i)}, "", std::string(1'000, 'x')}, {}, at(1));
    }
    return file;
}

TEST(SqliteJobStore, FindsNothingWrongWithAWholeFileOrNone) {
    const TemporaryDirectory directory;

    EXPECT_NO_THROW(check_sqlite_store(directory.path() / "none.sqlite"));
    EXPECT_NO_THROW(check_sqlite_store(make_store(directory)));
}

TEST(SqliteJobStore, RefusesADamagedFileAndLeavesItAsItIs) {
    const TemporaryDirectory directory;
    const auto file = make_store(directory);
    {
        std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
        stream.seekp(2 * 4'096);
        stream << std::string(std::filesystem::file_size(file) - 2 * 4'096, '\xff');
    }
    const std::string damaged = bytes_of(file);

    EXPECT_THROW(check_sqlite_store(file), StoreError);
    EXPECT_EQ(bytes_of(file), damaged);
}

TEST(SqliteJobStore, RefusesAFileThatIsNoDatabase) {
    const TemporaryDirectory directory;
    const auto file = directory.path() / "store.sqlite";
    std::ofstream(file) << std::string(10'000, 'x');

    EXPECT_THROW(check_sqlite_store(file), StoreError);
    EXPECT_THROW((void)open_sqlite_store(file), StoreError);
    EXPECT_EQ(bytes_of(file), std::string(10'000, 'x'));
}

TEST(SqliteJobStore, RefusesTheDatabaseOfAnotherProgram) {
    const TemporaryDirectory directory;
    const auto file = directory.path() / "store.sqlite";
    sqlite::Connection(file, sqlite::Connection::Mode::ReadWrite)
        .execute("CREATE TABLE patients (name TEXT)");
    const std::string before = bytes_of(file);

    EXPECT_THROW(check_sqlite_store(file), StoreError);
    EXPECT_THROW((void)open_sqlite_store(file), StoreError);
    EXPECT_EQ(bytes_of(file), before);
}

TEST(SqliteJobStore, RefusesTheFileOfANewerVersion) {
    const TemporaryDirectory directory;
    const auto file = make_store(directory);
    sqlite::Connection(file, sqlite::Connection::Mode::ReadWrite)
        .execute("PRAGMA user_version = 99");

    EXPECT_THROW(check_sqlite_store(file), StoreError);
    EXPECT_THROW((void)open_sqlite_store(file), StoreError);
}

constexpr const char* kVersion1 = R"sql(
CREATE TABLE jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant TEXT NOT NULL,
    id TEXT NOT NULL,
    request_id TEXT,
    spec BLOB NOT NULL,
    priority INTEGER NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'cancelling', 'succeeded', 'failed',
                                         'cancelled', 'quarantined')),
    attempt INTEGER NOT NULL CHECK (attempt >= 0),
    max_attempts INTEGER NOT NULL CHECK (max_attempts >= 1),
    epoch INTEGER NOT NULL,
    revision INTEGER NOT NULL,
    create_time INTEGER NOT NULL,
    start_time INTEGER,
    end_time INTEGER,
    outcome BLOB NOT NULL,
    last_sequence INTEGER NOT NULL,
    UNIQUE (tenant, id),
    UNIQUE (tenant, request_id),
    CHECK ((state IN ('succeeded', 'failed', 'cancelled', 'quarantined'))
           = (end_time IS NOT NULL)),
    CHECK (state NOT IN ('running', 'cancelling', 'succeeded', 'failed', 'quarantined')
           OR start_time IS NOT NULL)
) STRICT;
CREATE INDEX jobs_by_queue ON jobs (priority DESC, number) WHERE state = 'queued';
CREATE INDEX jobs_by_tenant ON jobs (tenant, number);

CREATE TABLE events (
    job INTEGER NOT NULL REFERENCES jobs (number) ON DELETE CASCADE,
    sequence INTEGER NOT NULL CHECK (sequence >= 1),
    time INTEGER NOT NULL,
    kind INTEGER NOT NULL,
    payload BLOB NOT NULL,
    state TEXT,
    attempt INTEGER,
    PRIMARY KEY (job, sequence)
) STRICT, WITHOUT ROWID;

CREATE TABLE artifacts (
    tenant TEXT NOT NULL,
    sha256 TEXT NOT NULL CHECK (length(sha256) = 64),
    size INTEGER NOT NULL CHECK (size >= 0),
    create_time INTEGER NOT NULL,
    PRIMARY KEY (tenant, sha256)
) STRICT, WITHOUT ROWID;

CREATE TABLE job_artifacts (
    job INTEGER NOT NULL REFERENCES jobs (number) ON DELETE CASCADE,
    role TEXT NOT NULL CHECK (role IN ('input', 'output', 'preview')),
    sha256 TEXT NOT NULL,
    tenant TEXT NOT NULL,
    PRIMARY KEY (job, role, sha256),
    FOREIGN KEY (tenant, sha256) REFERENCES artifacts (tenant, sha256)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_artifacts_by_artifact ON job_artifacts (tenant, sha256);
)sql";

TEST(SqliteJobStore, TakesOverWhatTheFirstVersionWrote) {
    const TemporaryDirectory directory;
    const auto file = directory.path() / "store.sqlite";
    {
        sqlite::Connection old(file, sqlite::Connection::Mode::ReadWrite);
        old.execute(kVersion1);
        old.execute(R"sql(
            INSERT INTO artifacts VALUES ('clinic', printf('%064d', 1), 10, 5);
            INSERT INTO jobs VALUES
                (3, 'clinic', 'done', 'r', x'01', 7, 'succeeded', 1, 3, 1, 3, 100, 200, 300, x'02', 3),
                (4, 'clinic', 'runs', NULL, x'01', 0, 'running', 4, 3, 4, 9, 100, 90, NULL, x'', 2);
            INSERT INTO events VALUES
                (3, 1, 100, 0, x'', 'queued', 0), (3, 2, 200, 0, x'', 'running', 1),
                (3, 3, 300, 0, x'', 'succeeded', 1),
                (4, 1, 100, 0, x'', 'queued', 0), (4, 2, 110, 1, x'07', NULL, NULL);
            INSERT INTO job_artifacts VALUES (3, 'input', printf('%064d', 1), 'clinic');
            PRAGMA user_version = 1;)sql");
    }

    const auto store = open_sqlite_store(file);

    const auto done = store->find({"clinic", "done"});
    ASSERT_TRUE(done);
    EXPECT_EQ(done->state, JobState::Succeeded);
    EXPECT_EQ(done->priority, 7);
    EXPECT_EQ(done->outcome, "\x02");
    EXPECT_EQ(done->last_sequence, 3);
    EXPECT_EQ(store->events_after(done->key, 0, 10).size(), 3U);
    EXPECT_FALSE(store->remove_artifact("clinic", std::string(63, '0') + "1"));
    const auto held = store->held();
    ASSERT_EQ(held.size(), 1U);
    EXPECT_EQ(held[0].start_time, held[0].create_time);
    const Loss loss{.last_state = JobState::Quarantined, .outcome = "lost"};
    EXPECT_EQ(store->lose({held[0].key, held[0].epoch}, loss, at(1))->state, JobState::Quarantined);
    EXPECT_NO_THROW(check_sqlite_store(file));
}

/// Creates jobs until the disk is full. \return how many were acknowledged
int create_until_full(JobStore& store) {
    for (int i = 0; i < 1'000; ++i) {
        try {
            store.create({{"clinic", std::to_string(i)}, "", std::string(5'000, 'x')}, {}, at(1));
        } catch (const StoreError& error) {
            EXPECT_EQ(error.kind(), StoreError::Kind::Full) << error.what();
            return i;
        }
    }
    return 1'000;
}

TEST(SqliteJobStore, KeepsWhatItAcknowledgedOnAFullDiskAndGoesOnLater) {
    const TemporaryDirectory directory;
    const auto file = directory.path() / "store.sqlite";
    auto store = open_sqlite_store(file);
    int acknowledged = 0;
    {
        const FullDisk full(400'000);
        acknowledged = create_until_full(*store);
    }
    EXPECT_GT(acknowledged, 0);
    EXPECT_LT(acknowledged, 1'000);

    const auto later = store->create({{"clinic", "later"}, "", "x"}, {}, at(1));
    store.reset();
    check_sqlite_store(file);
    store = open_sqlite_store(file);

    EXPECT_EQ(later.verdict, Creation::Verdict::Created);
    EXPECT_EQ(store->list({"clinic", {}, {}, 2'000}).size(),
              static_cast<std::size_t>(acknowledged) + 1);
}

TEST(DataDir, IsForOneServerAtATime) {
    const TemporaryDirectory directory;
    {
        const DataDir first(directory.path() / "data");
        EXPECT_THROW(DataDir(directory.path() / "data"), StoreError);
    }
    EXPECT_NO_THROW(DataDir(directory.path() / "data"));
}

TEST(DataDir, MayNotLieOnANetworkFileSystem) {
    EXPECT_TRUE(is_network_file_system(0x6969)) << "NFS";
    EXPECT_TRUE(is_network_file_system(0xff534d42)) << "CIFS";
    EXPECT_TRUE(is_network_file_system(0xffffffffff534d42)) << "CIFS, sign-extended";
    EXPECT_FALSE(is_network_file_system(0xef53)) << "ext4";
    EXPECT_FALSE(is_network_file_system(0x01021994)) << "tmpfs";
}

TEST(WorkerRoster, KnowsWhoLives) {
    const TemporaryDirectory directory;
    const WorkerRoster roster(directory.path());
    {
        const WorkerEntry entry(roster, "one");

        EXPECT_TRUE(roster.is_alive("one"));
        EXPECT_FALSE(roster.is_alive("two"));
        roster.tidy();
        EXPECT_EQ(roster.alive(), std::vector<std::string>{"one"});
    }
    EXPECT_FALSE(roster.is_alive("one"));
    EXPECT_EQ(roster.alive(), std::vector<std::string>{});
}

TEST(WorkerRoster, KnowsThatAKilledProcessIsDead) {
    const TemporaryDirectory directory;
    const WorkerRoster roster(directory.path());
    const pid_t child = fork();
    if (child == 0) {
        const WorkerEntry entry(roster, "child");
        ::kill(::getpid(), SIGSTOP);
        std::_Exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, WUNTRACED);
    EXPECT_TRUE(roster.is_alive("child"));

    ::kill(child, SIGKILL);
    ::waitpid(child, &status, 0);

    EXPECT_FALSE(roster.is_alive("child"));
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

TEST_F(ArtifactStoreTest, TakesBackFilesWhoseRecordFailed) {
    std::vector<ArtifactDraft> drafts;
    drafts.push_back(draft_of("hello"));

    EXPECT_THROW(artifacts.publish(std::move(drafts), [] { throw StoreError("full"); }),
                 StoreError);

    EXPECT_FALSE(std::filesystem::exists(path_of("hello")));
}

TEST_F(ArtifactStoreTest, LeavesADraftAloneAsLongAsItsWriterLives) {
    ArtifactDraft draft = draft_of("hello");

    artifacts.collect_garbage(at(5));

    EXPECT_TRUE(artifacts.add(std::move(draft), at(6)));
    EXPECT_TRUE(std::filesystem::exists(path_of("hello")));
}

TEST_F(ArtifactStoreTest, KeepsNoFileThatItsTenantMayNotKeep) {
    EXPECT_FALSE(artifacts.add(draft_of("hello"), at(1), 4));

    EXPECT_FALSE(std::filesystem::exists(path_of("hello")));
}

TEST_F(ArtifactStoreTest, SaysThatTheDiskIsFull) {
    ArtifactDraft draft = artifacts.draft("clinic");
    const FullDisk full(1'000);

    try {
        draft.write(std::string(2'000, 'x'));
        FAIL() << "it fitted";
    } catch (const StoreError& error) {
        EXPECT_EQ(error.kind(), StoreError::Kind::Full);
    }
}

TEST_F(ArtifactStoreTest, NoticesAFileOfAnotherSize) {
    artifacts.add(draft_of("hello"), at(1));
    std::filesystem::resize_file(path_of("hello"), 3);

    EXPECT_THROW((void)artifacts.open("clinic", {sha256_of("hello"), 5}), StoreError);
    EXPECT_FALSE(artifacts.find_whole("clinic", sha256_of("hello")));
    artifacts.add(draft_of("hello"), at(2));
    EXPECT_EQ(artifacts.open("clinic", {sha256_of("hello"), 5}).bytes(), "hello");
}

TEST_F(ArtifactStoreTest, SetsAsideWhatNoLongerHasItsDigestUntilItComesAgain) {
    artifacts.add(draft_of("hello"), at(1));
    const ArtifactId artifact{sha256_of("hello"), 5};
    const auto check = [&] {
        artifacts.require_whole("clinic", artifacts.open("clinic", artifact), [] {});
    };
    EXPECT_NO_THROW(check());
    std::ofstream(path_of("hello")) << "hullo";
    const auto aside = path_of("hello").replace_filename(".damaged-" + artifact.sha256);

    EXPECT_TRUE(artifacts.find_whole("clinic", artifact.sha256)) << "its size is right";
    EXPECT_THROW(check(), StoreError);
    EXPECT_FALSE(artifacts.find_whole("clinic", artifact.sha256));
    EXPECT_TRUE(artifacts.find("clinic", artifact.sha256)) << "jobs may still name it";
    artifacts.collect_garbage(at(0));
    EXPECT_TRUE(std::filesystem::exists(aside)) << "somebody may want to look at it";

    artifacts.add(draft_of("hello"), at(2));
    EXPECT_NO_THROW(check());
    EXPECT_FALSE(std::filesystem::exists(aside));
}

TEST_F(ArtifactStoreTest, NeverSetsAsideWhatTookTheDamagedOnesPlace) {
    artifacts.add(draft_of("hello"), at(1));
    const ArtifactId artifact{sha256_of("hello"), 5};
    std::ofstream(path_of("hello")) << "hullo";
    const ArtifactView damaged = artifacts.open("clinic", artifact);
    artifacts.add(draft_of("hello"), at(2));

    EXPECT_THROW(artifacts.require_whole("clinic", damaged, [] {}), StoreError);

    EXPECT_TRUE(artifacts.find_whole("clinic", artifact.sha256));
    EXPECT_EQ(artifacts.open("clinic", artifact).bytes(), "hello");
}

TEST_F(ArtifactStoreTest, RemovesWhatWasSetAsideWithItsRecord) {
    artifacts.add(draft_of("hello"), at(1));
    std::ofstream(path_of("hello")) << "hullo";
    EXPECT_THROW(
        artifacts.require_whole("clinic", artifacts.open("clinic", {sha256_of("hello"), 5}), [] {}),
        StoreError);

    artifacts.remove_unneeded("clinic", {sha256_of("hello")});

    EXPECT_TRUE(std::filesystem::is_empty(path_of("hello").parent_path()));
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

using Finding = CheckpointFiles::Finding;

const std::string kStateKey(64, 'e');

TEST(CheckpointFiles, GiveBackTheNewestStateOfEachJob) {
    const TemporaryDirectory directory;
    const CheckpointFiles files(directory.path());
    EXPECT_EQ(files.load({"clinic", "a"}, kStateKey).finding, Finding::None);

    files.save({"clinic", "a"}, kStateKey, {"old"});
    files.save({"clinic", "a"}, kStateKey, {"half and ", "half"});
    files.save({"other", "a"}, kStateKey, {});

    EXPECT_EQ(files.load({"clinic", "a"}, kStateKey).state, "half and half");
    EXPECT_EQ(files.load({"other", "a"}, kStateKey).finding, Finding::Good);
    files.remove({"clinic", "a"});
    EXPECT_EQ(files.load({"clinic", "a"}, kStateKey).finding, Finding::None);
}

TEST(CheckpointFiles, TellAStateOfAnotherSpecOrEngineAndADamagedOne) {
    const TemporaryDirectory directory;
    const CheckpointFiles files(directory.path());
    const JobKey job{"clinic", "a"};
    const auto file = directory.path() / "tenants" / "clinic" / "checkpoints" / "a";
    files.save(job, kStateKey, {"state"});
    const std::string good = bytes_of(file);

    EXPECT_EQ(files.load(job, std::string(64, 'f')).finding, Finding::Stale);
    for (const std::size_t size : {std::size_t{0}, std::size_t{30}, good.size() - 1}) {
        std::ofstream(file, std::ios::binary) << good.substr(0, size);
        EXPECT_EQ(files.load(job, kStateKey).finding, Finding::Damaged) << size;
    }
    std::string flipped = good;
    flipped.back() = 'E';
    std::ofstream(file, std::ios::binary) << flipped;
    EXPECT_EQ(files.load(job, kStateKey).finding, Finding::Damaged);
}

TEST(CheckpointFiles, AreTheOwnersAloneAndGoWithTheirJobs) {
    const TemporaryDirectory directory;
    const CheckpointFiles files(directory.path());
    const auto folder = directory.path() / "tenants" / "clinic" / "checkpoints";
    files.save({"clinic", "a"}, kStateKey, {"state"});
    files.save({"clinic", "b"}, kStateKey, {"state"});
    std::ofstream(folder / "b.4711") << "of a writer that was killed";

    EXPECT_EQ(std::filesystem::status(folder / "a").permissions(),
              std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    files.collect_garbage([](const JobKey& job) { return job == JobKey{"clinic", "a"}; });

    EXPECT_EQ(files.load({"clinic", "a"}, kStateKey).finding, Finding::Good);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
}

}  // namespace
}  // namespace remesh
