#include "core/estimate.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/pipeline.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

void expect_within_factor_two(const SurfaceMesh& input, double h) {
    RemeshOptions options;
    options.edge_length = h;
    RunContext run;
    const auto tets = static_cast<double>(run_pipeline(input, options, run).tets.tets.size());

    const RunEstimate estimate = estimate_run(input, options);

    EXPECT_GT(static_cast<double>(estimate.tets), 0.5 * tets);
    EXPECT_LT(static_cast<double>(estimate.tets), 2.0 * tets);
}

TEST(EstimateRun, IsWithinAFactorOfTwoForARoundBody) {
    expect_within_factor_two(testing::icosphere(3), 0.15);
}

TEST(EstimateRun, IsWithinAFactorOfTwoForABodyWithEdges) {
    expect_within_factor_two(testing::l_shape(), 0.2);
}

TEST(EstimateRun, LeavesOutVerticesThatTheRunLeavesOut) {
    SurfaceMesh input = testing::icosphere(3);
    const RunEstimate sound = estimate_run(input, {.edge_length = 0.15});
    input.vertices[0].x() = std::numeric_limits<double>::quiet_NaN();
    input.vertices[1].y() = 1e30;

    const RunEstimate estimate = estimate_run(input, {.edge_length = 0.15});

    EXPECT_LT(estimate.tets, 2 * sound.tets);
    EXPECT_LT(estimate.memory_bytes, 2 * sound.memory_bytes);
}

TEST(EstimateRun, OfASurfaceAloneIsWithinAFactorOfTwoAndKnowsNoTets) {
    const SurfaceMesh input = testing::icosphere(3);
    RunContext run;
    const RemeshOptions options{.edge_length = 0.15, .tetrahedra = false};
    const auto triangles =
        static_cast<double>(run_pipeline(input, options, run).surface.triangles.size());

    const RunEstimate estimate = estimate_run(input, options);

    EXPECT_EQ(estimate.tets, 0);
    EXPECT_GT(static_cast<double>(estimate.triangles), 0.5 * triangles);
    EXPECT_LT(static_cast<double>(estimate.triangles), 2.0 * triangles);
}

TEST(EstimateRun, OfASurfaceAloneGrowsWithTheSquareOfTheFineness) {
    const SurfaceMesh input = testing::unit_cube();

    const RunEstimate few = estimate_run(input, {.edge_length = 0.002, .tetrahedra = false});
    const RunEstimate many = estimate_run(input, {.edge_length = 0.001, .tetrahedra = false});

    EXPECT_NEAR(static_cast<double>(many.triangles), 4.0 * static_cast<double>(few.triangles), 4.0);
    EXPECT_LT(many.memory_bytes, 4 * few.memory_bytes);
}

TEST(EstimateRun, GrowsWithTheCubeOfTheFineness) {
    RemeshOptions coarse;
    coarse.edge_length = 0.02;
    RemeshOptions fine;
    fine.edge_length = 0.01;
    const SurfaceMesh input = testing::unit_cube();

    const RunEstimate few = estimate_run(input, coarse);
    const RunEstimate many = estimate_run(input, fine);

    EXPECT_GT(many.tets, 7 * few.tets);
    EXPECT_GT(many.memory_bytes, 4 * few.memory_bytes);
    EXPECT_GT(many.cpu_seconds, 4.0 * few.cpu_seconds);
}

}  // namespace
}  // namespace remesh
