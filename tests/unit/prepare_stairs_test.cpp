#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/stages/chord_offset.h"
#include "core/stages/prepare.h"
#include "tests/support/prepared.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

using testing::count_of;
using testing::icosphere;
using testing::prepare;
using testing::sampled_volume;

TEST(ChordOffsets, AreTheSagittaOfABall) {
    const auto ball = icosphere(4);

    for (const double offset : chord_offsets(ball, ball.vertices, 0.3)) {
        EXPECT_NEAR(offset, 0.3 * 0.3 / 8.0, 1e-3);
    }
}

TEST(PrepareSurface, SmoothsStairsAndKeepsTheVolume) {
    const auto ball = [](const Vec3& x) { return x.norm() < 1.0; };
    const auto mesh =
        testing::voxel_surface(ball, {Vec3::Constant(-1.25), Vec3::Constant(1.25)}, 0.1);

    const auto result = prepare(mesh, 0.12);

    EXPECT_TRUE(result.smoothed);
    EXPECT_EQ(count_of(result, "NON_FINITE"), 0);
    EXPECT_NEAR(result.facts.volume, 4.0 / 3.0 * std::numbers::pi, 0.03 * 4.2);
    EXPECT_NEAR(sampled_volume(*result.domain), result.facts.volume, 0.02 * 4.2);
    EXPECT_LE(result.max_displacement, 0.6 * 0.12 + 0.1 * 0.12 * 3);
    EXPECT_GT(result.domain->closest({1.1, 0.9, 0.7}).normal.dot(Vec3(1.1, 0.9, 0.7).normalized()),
              0.95);
}

TEST(PrepareSurface, SmoothsStairsThatElementsWouldResolve) {
    const auto ball = [](const Vec3& x) { return x.norm() < 1.0; };
    const auto mesh =
        testing::voxel_surface(ball, {Vec3::Constant(-1.25), Vec3::Constant(1.25)}, 0.1);

    const auto result = prepare(mesh, 0.04);

    EXPECT_TRUE(result.smoothed);
    EXPECT_NEAR(sampled_volume(*result.domain), result.facts.volume, 0.02 * 4.2);
    EXPECT_GT(result.domain->closest({1.1, 0.9, 0.7}).normal.dot(Vec3(1.1, 0.9, 0.7).normalized()),
              0.95);
}

TEST(PrepareSurface, SmoothsStairsOfSlicesThickerThanElements) {
    constexpr double kThickness = 4.0;  // Of a slice, over the size of a voxel in it.
    const Vec3 stretch(1.0, 1.0, kThickness);
    const auto ball = [&](const Vec3& x) { return x.cwiseProduct(stretch).norm() < 1.0; };
    const auto mesh = testing::transformed(
        testing::voxel_surface(ball, {Vec3::Constant(-1.1), Vec3::Constant(1.1)}, 0.04),
        Eigen::Matrix3d(stretch.asDiagonal()), Vec3::Zero());

    const auto result = prepare(mesh, 0.08);

    ASSERT_TRUE(result.smoothed);
    EXPECT_NEAR(sampled_volume(*result.domain), 4.0 / 3.0 * std::numbers::pi, 0.03 * 4.2);
    double mean = 0.0;
    const int kSamples = 500;
    for (int i = 0; i < kSamples; ++i) {  // Along a spiral.
        const double z = 0.7 - 1.4 * (i + 0.5) / kSamples;
        const double r = std::sqrt(1.0 - z * z);
        const Vec3 out(r * std::cos(0.7 * i), r * std::sin(0.7 * i), z);
        mean += result.domain->closest(out).normal.dot(out) / kSamples;
    }
    EXPECT_GT(mean, 0.965);
}

TEST(PrepareSurface, LeavesThePlainSidesOfAnEvenlyMeshedCube) {
    const auto cube = [](const Vec3& x) { return x.cwiseAbs().maxCoeff() < 1.0; };
    const auto mesh =
        testing::voxel_surface(cube, {Vec3::Constant(-1.25), Vec3::Constant(1.25)}, 0.1);

    EXPECT_FALSE(prepare(mesh, 0.04).smoothed);
}

TEST(PrepareSurface, LeavesStairsWhenSmoothingIsOff) {
    const auto ball = [](const Vec3& x) { return x.norm() < 1.0; };
    const auto mesh =
        testing::voxel_surface(ball, {Vec3::Constant(-1.25), Vec3::Constant(1.25)}, 0.1);

    const auto result = prepare(mesh, 0.12, {.smoothing = Smoothing::Off});

    EXPECT_FALSE(result.smoothed);
    EXPECT_EQ(result.max_displacement, 0.0);
}

}  // namespace
}  // namespace remesh
