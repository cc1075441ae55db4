// What becomes of jobs whose run, worker, server or disk was lost, and of what is old.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/run_state.h"
#include "server/jobs/losses.h"
#include "tests/support/job_machine.h"

namespace remesh {
namespace {

using testing::behind;
using testing::code_of;
using testing::Gate;
using testing::JobMachine;
using testing::ScriptedEngine;
using testing::TextCodec;

/// Keeps a record and stays, the first time; then tells what it goes on from.
ScriptedEngine::Script keeping(const std::string& record, Gate& gate) {
    return [record, &gate](const JobRequest&, const JobFiles&, RunContext& run,
                           OutputSink& outputs) {
        const std::string earlier(run.state()->begin());
        run.state()->keep(record);
        run.enter(Stage::Relax);
        gate.pass(run);
        JobResult result;
        const auto artifact = outputs.add([&](std::ostream& out) { out << "from:" << earlier; });
        result.outputs.push_back({OutputKind::Surface, MeshFormat::Stl, artifact, "out.stl"});
        return result;
    };
}

TEST(JobMachine, GoesOnFromTheCheckpointThatAShutdownLeft) {
    Gate gate;
    JobMachine machine(keeping("halfway", gate));
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);
    gate.wait_for_a_run();
    machine.stop();

    gate.open();
    machine.start();
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(key, JobState::Succeeded).attempt, 1);
    EXPECT_TRUE(machine.artifacts().find("clinic", sha256_of("from:halfway")));
    machine.stop();  // the worker has cleaned up behind itself
    machine.start();
    EXPECT_EQ(machine.artifacts().checkpoints().load(key, "").finding,
              CheckpointFiles::Finding::None);
}

TEST(JobMachine, BeginsAnewWhereACheckpointIsOfNoUse) {
    Gate gate;
    gate.open();
    JobMachine machine(keeping("halfway", gate));
    const JobKey damaged = machine.submit("one");
    const JobKey malformed = machine.submit("two");
    machine.artifacts().checkpoints().save(damaged, "another spec", {"state"});
    machine.artifacts().checkpoints().save(malformed, "", {"not a number of records"});
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(damaged, JobState::Succeeded).state, JobState::Succeeded);
    EXPECT_EQ(machine.wait_for(malformed, JobState::Succeeded).state, JobState::Succeeded);
    EXPECT_TRUE(machine.artifacts().find("clinic", sha256_of("from:")));
}

TEST(JobMachine, LooksAfterHalfUploadsWhenItCleansUp) {
    JobMachine machine;
    Time before{};
    HousekeeperOptions options;
    options.keep_uploads = std::chrono::hours(2);
    options.remove_uploads = [&](Time time) { before = time; };
    TextCodec codec;
    Housekeeper housekeeper(
        machine.store(), machine.artifacts(), machine.registry(), codec,
        [](const std::string&) { return true; }, options);

    housekeeper.clean_up(Time(std::chrono::hours(10)));

    EXPECT_EQ(before, Time(std::chrono::hours(8)));
}

TEST(JobMachine, DropsTheCheckpointOfAJobThatIsCancelledOrDeleted) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");
    const CheckpointFiles& files = machine.artifacts().checkpoints();
    files.save(key, "", {"state"});
    machine.registry().cancel(key);
    EXPECT_EQ(files.load(key, "").finding, CheckpointFiles::Finding::None);

    files.save(key, "", {"state"});
    machine.registry().remove(key, std::nullopt);
    EXPECT_EQ(files.load(key, "").finding, CheckpointFiles::Finding::None);
}

TEST(JobMachine, CountsADroppedLeaseAsLostAndQuarantinesAfterTheLast) {
    JobMachine machine(ScriptedEngine::copy_input, {.max_attempts = 2});
    const JobKey key = machine.submit("mesh");

    for (int attempt = 1; attempt <= 2; ++attempt) {
        const auto lease = machine.desk().claim({});
        ASSERT_TRUE(lease);
        EXPECT_EQ(lease->job().attempt, attempt);
    }

    const JobRecord job = machine.wait_for(key, JobState::Quarantined);
    EXPECT_EQ(job.state, JobState::Quarantined);
    EXPECT_EQ(job.outcome, "WORKER_LOST");
}

TEST(JobMachine, GivesRunningJobsBackWhenItDrainsAndFinishesThemLater) {
    Gate gate;
    JobMachine machine(behind(gate));
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);
    machine.wait_for(key, JobState::Running);

    machine.stop();
    machine.start();
    const JobRecord waiting = machine.registry().get(key).job;
    gate.open();
    machine.start_workers(1);

    EXPECT_EQ(waiting.state, JobState::Queued);
    EXPECT_EQ(waiting.attempt, 0);
    EXPECT_EQ(machine.wait_for(key, JobState::Succeeded).attempt, 1);
}

TEST(JobMachine, RefusesNewJobsWhileItDrains) {
    JobMachine machine;
    const ArtifactId input = machine.upload("mesh");
    machine.registry().drain();
    machine.desk().drain();

    EXPECT_EQ(code_of([&] {
                  machine.registry().submit({"clinic", "", TextCodec::spec(input, 0), false});
              }),
              JobErrorCode::ShuttingDown);
    EXPECT_FALSE(machine.desk().claim({}));
}

TEST(JobMachine, TakesUpWhatAKilledServerLeft) {
    JobMachine machine;
    const JobKey running = machine.submit("one");
    const JobKey cancelling = machine.submit("two");
    const JobKey queued = machine.submit("three");
    // Claimed behind the registry's back: nobody is left to settle them.
    machine.store().claim({"killed", std::nullopt}, system_now());
    machine.store().claim({"killed", std::nullopt}, system_now());
    machine.store().request_cancel(cancelling, system_now());

    machine.stop();
    machine.start();
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(running, JobState::Succeeded).attempt, 2);
    EXPECT_EQ(machine.wait_for(queued, JobState::Succeeded).attempt, 1);
    EXPECT_EQ(machine.registry().get(cancelling).job.state, JobState::Cancelled);
}

TEST(JobMachine, GivesTheJobsOfSilentWorkersToOthers) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");
    // In the roster the machine's own worker lives, but nobody beats for this claim.
    const auto claimed = machine.store().claim({"machine", std::nullopt}, system_now());
    const Housekeeper::SteadyTime start{};

    EXPECT_EQ(machine.housekeeper().expire(start, system_now()), 0);
    EXPECT_EQ(machine.housekeeper().expire(start + std::chrono::seconds(29), system_now()), 0);
    machine.store().renew({key, claimed->epoch});
    EXPECT_EQ(machine.housekeeper().expire(start + std::chrono::seconds(31), system_now()), 0);
    EXPECT_EQ(machine.housekeeper().expire(start + std::chrono::seconds(60), system_now()), 0);
    EXPECT_EQ(machine.housekeeper().expire(start + std::chrono::seconds(61), system_now()), 1);
    machine.start_workers(1);
    EXPECT_EQ(machine.wait_for(key, JobState::Succeeded).attempt, 2);
}

TEST(JobMachine, LosesNoLeaseToAClockThatJumps) {
    JobMachine machine;
    machine.submit("mesh");
    machine.store().claim({"machine", std::nullopt}, system_now());
    const Housekeeper::SteadyTime start{};

    machine.housekeeper().expire(start, system_now());
    const Time tomorrow = system_now() + std::chrono::hours(24);
    EXPECT_EQ(machine.housekeeper().expire(start + std::chrono::seconds(1), tomorrow), 0);
    const Time yesterday = system_now() - std::chrono::hours(24);
    EXPECT_EQ(machine.housekeeper().expire(start + std::chrono::seconds(2), yesterday), 0);
}

TEST(JobMachine, TakesTheJobsOfDeadWorkersAtTheSecondLook) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");
    machine.store().claim({"dead", std::nullopt}, system_now());

    EXPECT_EQ(machine.housekeeper().expire({}, system_now()), 0);
    EXPECT_EQ(machine.housekeeper().expire({}, system_now()), 1);
    EXPECT_EQ(machine.registry().get(key).job.crashes, 0);
}

TEST(JobMachine, QuarantinesAJobThatCrashedTwoWorkers) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");
    for (int i = 0; i < 2; ++i) {
        ASSERT_TRUE(machine.store().claim({"crashing", std::nullopt}, system_now()));
        EXPECT_EQ(
            lose_all_of("crashing", LossCause::Crash, machine.store(), TextCodec(), system_now()),
            1);
    }

    EXPECT_EQ(machine.registry().get(key).job.state, JobState::Quarantined);
    EXPECT_EQ(machine.registry().get(key).job.outcome, "WORKER_LOST");
}

TEST(JobMachine, TriesAgainWhenTheStoreFailsARun) {
    std::atomic<int> runs = 0;
    JobMachine machine([&](const JobRequest& request, const JobFiles& input, RunContext& run,
                           OutputSink& outputs) {
        if (++runs == 1) {
            throw StoreError("the disk is full", StoreError::Kind::Full);
        }
        return ScriptedEngine::copy_input(request, input, run, outputs);
    });
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(key, JobState::Succeeded).attempt, 2);
}

TEST(JobMachine, FailsAJobThatTheStoreFailsEveryTime) {
    JobMachine machine([](const JobRequest&, const JobFiles&, RunContext&,
                          OutputSink&) -> JobResult { throw StoreError("the disk is full"); },
                       {.max_attempts = 2});
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(key, JobState::Failed).outcome, "STORAGE");
}

TEST(JobMachine, FailsAJobWhoseInputWasDamagedAndRunsItOnceThatIsMended) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");
    const ArtifactId input{sha256_of("mesh"), 4};
    std::ofstream(machine.directory() / "tenants/clinic/artifacts" / input.sha256) << "mash";
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(key, JobState::Failed).outcome, "STORAGE");
    EXPECT_FALSE(machine.artifacts().find_whole("clinic", input.sha256));
    EXPECT_EQ(code_of([&] { machine.registry().retry(key, ""); }), JobErrorCode::MissingInput);

    machine.upload("mesh");
    const JobKey again = machine.registry().retry(key, "").job.key;
    EXPECT_EQ(machine.wait_for(again, JobState::Succeeded).attempt, 1);
}

TEST(JobMachine, FailsAJobAtOnceWhoseInputIsGone) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");
    std::filesystem::remove(machine.directory() / "tenants/clinic/artifacts" / sha256_of("mesh"));
    machine.start_workers(1);

    const JobRecord job = machine.wait_for(key, JobState::Failed);

    EXPECT_EQ(job.outcome, "STORAGE");
    EXPECT_EQ(job.attempt, 1) << "waiting doesn't bring it back";
}

TEST(JobMachine, DeletesWhatIsOld) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);
    machine.wait_for(key, JobState::Succeeded);
    const ArtifactId unused = machine.upload("unused");
    Housekeeper keeper(machine.store(), machine.artifacts(), machine.registry(), TextCodec(),
                       [](const std::string&) { return true; },
                       {.keep_uploads = std::chrono::hours(1), .keep_jobs = std::chrono::hours(2)});

    keeper.clean_up(system_now());
    EXPECT_TRUE(machine.artifacts().find("clinic", unused.sha256));
    keeper.clean_up(system_now() + std::chrono::minutes(90));
    EXPECT_FALSE(machine.artifacts().find("clinic", unused.sha256));
    EXPECT_EQ(machine.registry().get(key).job.state, JobState::Succeeded);
    keeper.clean_up(system_now() + std::chrono::minutes(150));
    EXPECT_EQ(code_of([&] { machine.registry().get(key); }), JobErrorCode::NotFound);
    EXPECT_FALSE(machine.artifacts().find("clinic", sha256_of("out:mesh")));
}

}  // namespace
}  // namespace remesh
