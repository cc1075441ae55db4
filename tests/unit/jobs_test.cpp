#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <set>
#include <stdexcept>

#include "core/error.h"
#include "core/run_state.h"
#include "server/jobs/losses.h"
#include "tests/support/job_machine.h"

namespace remesh {
namespace {

using testing::behind;
using ::testing::ElementsAre;
using testing::Gate;
using testing::JobMachine;
using testing::ScriptedEngine;
using ::testing::SizeIs;
using testing::TextCodec;

JobErrorCode code_of(const std::function<void()>& call) {
    try {
        call();
    } catch (const JobError& error) {
        return error.code();
    }
    throw std::logic_error("no JobError came");
}

TEST(JobMachine, RunsAJobAndShowsItsOutputs) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    const JobRecord job = machine.wait_for(key, JobState::Succeeded);

    EXPECT_EQ(job.state, JobState::Succeeded);
    EXPECT_EQ(job.attempt, 1);
    EXPECT_EQ(job.outcome, "result of 1");
    const auto output = machine.artifacts().find("clinic", sha256_of("out:mesh"));
    ASSERT_TRUE(output);
    EXPECT_EQ(machine.artifacts().open("clinic", *output).bytes(), "out:mesh");
}

TEST(JobMachine, NumbersTheEventsOfARunInTheOrderTheyCame) {
    JobMachine machine([](const JobRequest&, const JobFiles&, RunContext& run, OutputSink&) {
        run.enter(Stage::Relax);
        run.sample({.quality = QualitySample{}});
        run.sample({.quality = QualitySample{}});
        run.warn({"ODD", "Something is odd.", std::nullopt});
        return JobResult{};
    });
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);
    machine.wait_for(key, JobState::Succeeded);

    std::vector<std::string> payloads;
    std::int64_t sequence = 0;
    for (const StoredEvent& event : machine.registry().events_after(key, 0, 100)) {
        EXPECT_EQ(event.sequence, ++sequence);
        payloads.push_back(event.kind == EventKind::State ? "state" : event.payload);
    }

    EXPECT_THAT(payloads, ElementsAre("state", "state", "progress", "sample 1", "sample 2",
                                      "warning ODD", "state"));
}

TEST(JobMachine, TellsWhyARunFailed) {
    JobMachine machine(
        [](const JobRequest&, const JobFiles&, RunContext&, OutputSink& outputs) -> JobResult {
            outputs.add([](std::ostream& out) { out << "half a result"; });
            throw Error(ErrorCode::Unmeshable, "no body");
        });
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    const JobRecord job = machine.wait_for(key, JobState::Failed);

    EXPECT_EQ(job.outcome, "UNMESHABLE");
    EXPECT_FALSE(machine.artifacts().find("clinic", sha256_of("half a result")));
}

TEST(JobMachine, KeepsTheReportOfAResultThatBreaksABound) {
    JobMachine machine(
        [](const JobRequest&, const JobFiles&, RunContext&, OutputSink& outputs) -> JobResult {
            JobResult result;
            const auto report = outputs.add([](std::ostream& out) { out << "a report"; });
            result.outputs.push_back({OutputKind::Report, std::nullopt, report, "quality.json"});
            result.broken_bounds = "min_dihedral is 12, the bound is 20";
            return result;
        });
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    const JobRecord job = machine.wait_for(key, JobState::Failed);

    EXPECT_EQ(job.outcome, "BOUND_NOT_MET");
    EXPECT_TRUE(machine.artifacts().find("clinic", sha256_of("a report")));
}

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

TEST(JobMachine, FailsTheJobOfAnEngineThatThrowsSomethingElse) {
    JobMachine machine([](const JobRequest&, const JobFiles&, RunContext&,
                          OutputSink&) -> JobResult { throw std::logic_error("a defect"); });
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(key, JobState::Failed).outcome, "INTERNAL");
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

TEST(JobMachine, CancelsAQueuedJobAtOnce) {
    JobMachine machine;
    const JobKey key = machine.submit("mesh");

    EXPECT_EQ(machine.registry().cancel(key).job.state, JobState::Cancelled);
    EXPECT_EQ(machine.registry().cancel(key).job.state, JobState::Cancelled);
}

TEST(JobMachine, StopsARunningJobThatIsCancelled) {
    Gate gate;
    JobMachine machine(behind(gate));
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);
    machine.wait_for(key, JobState::Running);

    EXPECT_EQ(machine.registry().cancel(key).job.state, JobState::Cancelling);
    EXPECT_EQ(machine.wait_for(key, JobState::Cancelled).state, JobState::Cancelled);
    EXPECT_FALSE(machine.artifacts().find("clinic", sha256_of("out:mesh")));
}

TEST(JobMachine, FailsAJobThatRunsTooLong) {
    Gate gate;
    JobMachine machine(behind(gate), {}, {.max_run_time = std::chrono::milliseconds(1)});
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(key, JobState::Failed).outcome, "TIMEOUT");
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

TEST(JobMachine, FailsAJobThatNeedsMoreMemoryThanItMay) {
    Gate gate;
    JobMachine machine(behind(gate), {}, {.max_process_bytes = 1});
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(key, JobState::Failed).outcome, "TOO_LARGE");
}

TEST(JobMachine, SubmitsAFailedJobAgainAsANewOne) {
    std::atomic<bool> is_broken = true;
    JobMachine machine([&](const JobRequest& request, const JobFiles& input, RunContext& run,
                           OutputSink& outputs) {
        if (is_broken) {
            throw Error(ErrorCode::Unmeshable, "no body");
        }
        return ScriptedEngine::copy_input(request, input, run, outputs);
    });
    const JobKey key = machine.submit("mesh");
    EXPECT_EQ(code_of([&] { machine.registry().retry(key, ""); }), JobErrorCode::NotRetryable);
    machine.start_workers(1);
    machine.wait_for(key, JobState::Failed);

    is_broken = false;
    const JobView again = machine.registry().retry(key, "r");
    const JobKey same = machine.registry().retry(key, "r").job.key;

    EXPECT_EQ(again.job.origin, key.id);
    EXPECT_EQ(same, again.job.key);
    machine.wait_for(again.job.key, JobState::Succeeded);
    EXPECT_EQ(machine.registry().get(key).job.state, JobState::Failed);
    EXPECT_EQ(code_of([&] { machine.registry().retry(same, ""); }), JobErrorCode::NotRetryable);
}

TEST(JobMachine, EstimatesWhenAJobWillStart) {
    JobMachine machine;
    EXPECT_FALSE(machine.registry().get(machine.submit("one")).estimated_start);
    machine.store().claim({"machine", std::nullopt}, system_now());
    const auto held = machine.store().held().front();
    machine.store().settle({held.key, held.epoch}, {JobState::Succeeded, "", {}, {}},
                           *held.start_time + std::chrono::seconds(100));

    const JobKey second = machine.submit("two");
    const JobKey third = machine.submit("three");
    const Time now = system_now();

    EXPECT_GE(machine.registry().get(third).estimated_start, now + std::chrono::seconds(100));
    EXPECT_LT(machine.registry().get(second).estimated_start, now + std::chrono::seconds(100));
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

TEST(JobMachine, RunsByPriorityThenAge) {
    std::mutex mutex;
    std::vector<std::string> order;
    JobMachine machine(
        [&](const JobRequest&, const JobFiles& input, RunContext&, OutputSink&) -> JobResult {
            const std::scoped_lock lock(mutex);
            order.emplace_back(input.surface);
            return {};
        });
    machine.submit("first");
    const JobKey last = machine.submit("low", -1);
    machine.submit("second");
    machine.submit("high", 1);

    machine.start_workers(1);
    machine.wait_for(last, JobState::Succeeded);

    EXPECT_THAT(order, ElementsAre("high", "first", "second", "low"));
}

TEST(JobMachine, RunsEachOfManyJobsOnceOnManyWorkers) {
    std::mutex mutex;
    std::multiset<std::string> runs;
    JobMachine machine([&](const JobRequest& request, const JobFiles& input, RunContext& run,
                           OutputSink& outputs) {
        {
            const std::scoped_lock lock(mutex);
            runs.emplace(input.surface);
        }
        return ScriptedEngine::copy_input(request, input, run, outputs);
    });
    machine.start_workers(4);
    std::vector<JobKey> keys;
    for (int i = 0; i < 20; ++i) {
        keys.push_back(machine.submit("mesh " + std::to_string(i)));
    }

    for (const JobKey& key : keys) {
        EXPECT_EQ(machine.wait_for(key, JobState::Succeeded).state, JobState::Succeeded);
    }
    EXPECT_THAT(runs, SizeIs(20));
    EXPECT_EQ(std::set<std::string>(runs.begin(), runs.end()).size(), 20U);
}

TEST(JobMachine, SettlesOneWayWhenACancelMeetsTheEnd) {
    JobMachine machine;
    machine.start_workers(2);
    for (int i = 0; i < 20; ++i) {
        const JobKey key = machine.submit("mesh " + std::to_string(i));
        machine.registry().cancel(key);
        const JobRecord job =
            machine.wait_until(key, [](const JobRecord& now) { return is_terminal(now.state); });

        const auto events = machine.registry().events_after(key, 0, 100);
        EXPECT_EQ(std::count_if(events.begin(), events.end(),
                                [](const StoredEvent& event) {
                                    return event.kind == EventKind::State &&
                                           is_terminal(event.state);
                                }),
                  1);
        EXPECT_EQ(events.back().state, job.state);
    }
}

TEST(JobMachine, ReturnsTheFirstJobForARepeatedRequest) {
    JobMachine machine;

    const JobKey first = machine.submit("mesh", 0, "r");
    const JobKey again = machine.submit("mesh", 0, "r");

    EXPECT_EQ(first, again);
    EXPECT_EQ(code_of([&] { machine.submit("mesh", 1, "r"); }), JobErrorCode::RequestIdReused);
}

TEST(JobMachine, RefusesMoreJobsThanMayWait) {
    JobMachine machine(ScriptedEngine::copy_input, {.limits = {.max_queued = 1}});
    machine.submit("one");

    EXPECT_EQ(code_of([&] { machine.submit("two"); }), JobErrorCode::LimitPassed);
}

TEST(JobMachine, KeepsTheNewestPreviewsOfARunAndNoneAfterIt) {
    Gate gate;
    JobMachine machine(
        [&](const JobRequest&, const JobFiles&, RunContext& run, OutputSink&) -> JobResult {
            for (std::size_t i = 1; i <= 12; ++i) {
                run.preview({.vertices = Points(i, Vec3::Zero())});
            }
            gate.pass(run);
            return {};
        });
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);
    machine.wait_until(key, [](const JobRecord& job) { return job.last_sequence >= 14; });

    const auto is_there = [&](int i) {
        return machine.artifacts()
            .find("clinic", sha256_of("preview of 0 triangles " + std::to_string(i)))
            .has_value();
    };
    EXPECT_TRUE(is_there(12));
    EXPECT_FALSE(is_there(1));
    gate.open();
    machine.wait_for(key, JobState::Succeeded);
    machine.stop();
    machine.start();
    EXPECT_FALSE(is_there(12));
}

TEST(JobMachine, DeletesAJobWithTheArtifactsThatNobodyElseNeeds) {
    JobMachine machine;
    const JobKey first = machine.submit("mesh");
    const JobKey second = machine.submit("mesh", 1);
    machine.start_workers(1);
    machine.wait_for(second, JobState::Succeeded);
    machine.wait_for(first, JobState::Succeeded);

    machine.registry().remove(first, {});
    EXPECT_TRUE(machine.artifacts().find("clinic", sha256_of("mesh")));
    machine.registry().remove(second, {});

    EXPECT_FALSE(machine.artifacts().find("clinic", sha256_of("mesh")));
    EXPECT_FALSE(machine.artifacts().find("clinic", sha256_of("out:mesh")));
    EXPECT_EQ(code_of([&] { machine.registry().get(first); }), JobErrorCode::NotFound);
}

}  // namespace
}  // namespace remesh
