#include "core/estimate.h"

#include <gtest/gtest.h>

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
