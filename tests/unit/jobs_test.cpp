#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <set>

#include "core/error.h"
#include "tests/support/job_machine.h"

namespace remesh {
namespace {

using testing::behind;
using testing::code_of;
using ::testing::ElementsAre;
using testing::Gate;
using testing::JobMachine;
using testing::ScriptedEngine;
using ::testing::SizeIs;
using testing::TextCodec;

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

TEST(JobMachine, FailsTheJobOfAnEngineThatThrowsSomethingElse) {
    JobMachine machine([](const JobRequest&, const JobFiles&, RunContext&,
                          OutputSink&) -> JobResult { throw std::logic_error("a defect"); });
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    EXPECT_EQ(machine.wait_for(key, JobState::Failed).outcome, "INTERNAL");
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

/// Runs that never look whether they shall stop, until they are let go.
class DeafRuns {
public:
    [[nodiscard]] ScriptedEngine::Script script() {
        return [this](const JobRequest& request, const JobFiles& inputs, RunContext& run,
                      OutputSink& outputs) {
            run.enter(Stage::Carve);
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [this] { return is_over_; });
            return ScriptedEngine::copy_input(request, inputs, run, outputs);
        };
    }
    [[nodiscard]] DeskOptions options() {
        return {.stop_grace = std::chrono::milliseconds(1), .on_stuck = [this] { ++stuck_; }};
    }
    [[nodiscard]] int stuck() const { return stuck_; }
    void let_go() {
        const std::scoped_lock lock(mutex_);
        is_over_ = true;
        changed_.notify_all();
    }

private:
    std::mutex mutex_;
    std::condition_variable changed_;
    bool is_over_ = false;  // needs mutex_
    std::atomic<int> stuck_ = 0;
};

TEST(JobMachine, EndsAJobWhoseRunDoesntStopWhenItsTimeIsOver) {
    DeafRuns runs;
    DeskOptions options = runs.options();
    options.max_run_time = std::chrono::milliseconds(1);
    JobMachine machine(runs.script(), {}, options);
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);

    const JobRecord ended = machine.wait_for(key, JobState::Failed);
    EXPECT_EQ(ended.outcome, "TIMEOUT");

    runs.let_go();
    machine.stop();
    EXPECT_EQ(runs.stuck(), 1);
    machine.start();
    EXPECT_EQ(machine.registry().get(key).job.revision, ended.revision) << "what it wrote is void";
    EXPECT_FALSE(machine.artifacts().find("clinic", sha256_of("out:mesh")));
}

TEST(JobMachine, EndsACancelledJobWhoseRunDoesntStop) {
    DeafRuns runs;
    JobMachine machine(runs.script(), {}, runs.options());
    const JobKey key = machine.submit("mesh");
    machine.start_workers(1);
    machine.wait_for(key, JobState::Running);

    machine.registry().cancel(key);

    EXPECT_EQ(machine.wait_for(key, JobState::Cancelled).state, JobState::Cancelled);
    runs.let_go();
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
