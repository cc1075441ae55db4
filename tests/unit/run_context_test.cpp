#include "core/run_context.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"

namespace remesh {
namespace {

TEST(RunContext, ProgressNeverGoesBackAndEndsNearOne) {
    std::vector<double> fractions;
    RunContext run({}, [&](const RunEvent& event) {
        fractions.push_back(std::get<Progress>(event).run_fraction);
    });

    run.enter(Stage::Relax);
    run.report(0.5);
    run.enter(Stage::Seed);
    run.report(7.0);
    run.enter(Stage::Write);
    run.report(1.0);

    EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
    EXPECT_DOUBLE_EQ(fractions.back(), 1.0);
}

TEST(RunContext, CountsIterationsOverTheWholeRun) {
    std::vector<int> iterations;
    RunContext run({}, [&](const RunEvent& event) {
        if (const auto* sample = std::get_if<ConvergenceSample>(&event)) {
            iterations.push_back(sample->iteration);
        }
    });

    run.enter(Stage::Relax);
    run.sample({});
    run.enter(Stage::Improve);
    run.sample({});

    EXPECT_EQ(iterations, (std::vector<int>{1, 2}));
}

TEST(RunContext, ARunStoppedBeforeItStartsThrowsAtTheFirstCheckpoint) {
    std::stop_source stop;
    stop.request_stop();
    RunContext run(stop.get_token());

    try {
        run.enter(Stage::Read);
        FAIL() << "entered a stage of a stopped run";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Cancelled);
    }
}

TEST(RunContext, AStopFromAnotherThreadLeavesAParallelLoop) {
    std::stop_source stop;
    const RunContext run(stop.get_token());

    EXPECT_THROW(for_each_index(std::size_t{1} << 40, run,
                                [&](std::size_t i) {
                                    if (i == 0) {
                                        stop.request_stop();
                                    }
                                }),
                 Error);
}

TEST(RunContext, WantsNoPreviewWithoutAListener) {
    EXPECT_FALSE(RunContext().wants_preview());
}

TEST(Parallel, SumIsTheSameForAnyNumberOfThreads) {
    const auto term = [](std::size_t i) { return 1.0 / (1.0 + static_cast<double>(i)); };
    double expected = 0.0;
    tbb::task_arena(1).execute([&] { expected = sum_over(100'000, term); });

    for (const int threads : {2, 3, 8}) {
        double actual = 0.0;
        tbb::task_arena(threads).execute([&] { actual = sum_over(100'000, term); });
        EXPECT_EQ(actual, expected) << threads << " threads";
    }
}

TEST(Parallel, EveryIndexIsVisitedOnce) {
    std::vector<int> visits(5000, 0);
    for_each_block(visits.size(), 64, RunContext(), [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            ++visits[i];
        }
    });

    EXPECT_EQ(visits, std::vector<int>(5000, 1));
}

}  // namespace
}  // namespace remesh
