#include "core/stages/bounds.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/pipeline.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

QualityReport some_report() {
    QualityReport report;
    report.tets = TetQuality{};
    report.tets->min_dihedral = 24.5;
    report.output_to_input.max = 0.25;
    report.input_to_output.max = 0.5;
    report.volume_change = -0.02;
    return report;
}

TEST(CheckBounds, SaysNothingWhereNothingWasAsked) {
    EXPECT_TRUE(check_bounds(some_report(), {}).empty());
    EXPECT_EQ(broken_bounds({}), "");
}

TEST(CheckBounds, TakesTheLargerDeviationAndTheSizeOfTheVolumeChange) {
    const auto checks = check_bounds(
        some_report(), {.min_dihedral = 24.5, .max_deviation = 0.5, .max_volume_change = 0.02});

    ASSERT_EQ(checks.size(), 3U);
    EXPECT_EQ(checks[0].value, 24.5);
    EXPECT_EQ(checks[1].value, 0.5);
    EXPECT_EQ(checks[2].value, 0.02);
    EXPECT_TRUE(checks[0].holds && checks[1].holds && checks[2].holds);
    EXPECT_EQ(broken_bounds(checks), "");
}

TEST(CheckBounds, NamesFigureAndBoundOfAllThatDontHold) {
    const auto checks = check_bounds(
        some_report(), {.min_dihedral = 27.0, .max_deviation = 1.0, .max_volume_change = 0.01});

    EXPECT_EQ(
        broken_bounds(checks),
        "min_dihedral is 24.5, the bound is 27; max_volume_change is 0.02, the bound is 0.01");
}

struct BadBounds {
    const char* sentence;
    BoundOptions bounds;
    bool tetrahedra;
};

class BoundOptionsTest : public ::testing::TestWithParam<BadBounds> {};

TEST_P(BoundOptionsTest, AreNamedWhenOutOfRange) {
    try {
        validate(GetParam().bounds, GetParam().tetrahedra);
        FAIL() << "expected an error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::InvalidInput);
        EXPECT_STREQ(error.what(), GetParam().sentence);
    }
}

INSTANTIATE_TEST_SUITE_P(
    All, BoundOptionsTest,
    ::testing::Values(
        BadBounds{"bounds.min_dihedral must be in (0, 70.5], got 71", {.min_dihedral = 71.0}, true},
        BadBounds{"bounds.min_dihedral must be absent in a job without tetrahedra, got 20",
                  {.min_dihedral = 20.0},
                  false},
        BadBounds{
            "bounds.max_deviation must be > 0 and finite, got 0", {.max_deviation = 0.0}, true},
        BadBounds{"bounds.max_volume_change must be > 0 and finite, got -1",
                  {.max_volume_change = -1.0},
                  true}));

TEST(MaxTets, RaisesTheEdgeLengthUntilTheTetsFitAndSaysSo) {
    std::vector<Warning> warnings;
    RunContext run({}, [&](const RunEvent& event) {
        if (const auto* warning = std::get_if<Warning>(&event)) {
            warnings.push_back(*warning);
        }
    });
    RemeshOptions options{.edge_length = 0.1};
    options.max_tets = 3000;

    const RemeshResult result = run_pipeline(testing::icosphere(3), options, run);

    EXPECT_LE(result.tets.tets.size(), 3000U);
    EXPECT_GT(result.tets.tets.size(), 1500U);
    EXPECT_GT(result.edge_length, 0.1);
    EXPECT_EQ(result.report.coarsened_from, 0.1);
    ASSERT_FALSE(warnings.empty());
    EXPECT_EQ(warnings.back().code, "COARSENED");
}

TEST(MaxTets, LeavesTheEdgeLengthAloneWhereTheTetsFit) {
    RunContext run;
    RemeshOptions options{.edge_length = 0.3};
    options.max_tets = 100'000;

    const RemeshResult result = run_pipeline(testing::icosphere(3), options, run);

    EXPECT_EQ(result.edge_length, 0.3);
    EXPECT_FALSE(result.report.coarsened_from);
}

TEST(MaxTets, MustBeAtLeastAHundred) {
    RemeshOptions options{};
    options.max_tets = 99;

    try {
        validate(options);
        FAIL() << "expected an error";
    } catch (const Error& error) {
        EXPECT_STREQ(error.what(), "max_tets must be >= 100, got 99");
    }
}

}  // namespace
}  // namespace remesh
