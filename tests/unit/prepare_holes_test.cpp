#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/stages/prepare.h"
#include "tests/support/prepared.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

using testing::count_of;
using testing::kTorusVolume;
using testing::prepare;
using testing::sampled_volume;
using testing::some_torus;
using testing::torus;

TEST(PrepareSurface, ClosesHoles) {
    auto mesh = some_torus();
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        return (mesh.vertices[static_cast<std::size_t>(t[0])] - Vec3(1.4, 0, 0)).norm() < 0.2;
    });

    const auto result = prepare(mesh, 0.1);

    EXPECT_EQ(count_of(result, "OPEN_BOUNDARY"), 1);
    EXPECT_NEAR(sampled_volume(*result.domain), kTorusVolume, 0.02 * kTorusVolume);
    EXPECT_LT(result.domain->closest({1.4, 0.0, 0.0}).distance, 0.05);
}

// Each missing triangle takes its solid angle from w everywhere: unless they are put back, the
// level 1/2 lies far below the surface.
TEST(PrepareSurface, KeepsTheVolumeWhereTrianglesAreMissingAllOver) {
    auto ball = testing::icosphere(4);
    const double whole = prepare(ball, 0.1).facts.volume;

    const auto result = prepare(testing::with_triangles_removed(ball, 0.2, 3), 0.1);

    EXPECT_NEAR(result.facts.volume, whole, 0.003 * whole);
    EXPECT_NEAR(sampled_volume(*result.domain), whole, 0.01 * whole);
}

TEST(PrepareSurface, DoesNotCapTheEndsThatATubeHasWhereARingIsMissing) {
    // The tube is narrower than what is filled smoothly, the gap shorter than the tube is wide.
    auto mesh = torus(1.0, 0.1, 120, 12);
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        const Vec3& at = mesh.vertices[static_cast<std::size_t>(t[0])];
        return at.x() > 0.0 && std::abs(at.y()) < 0.03;
    });

    const auto result = prepare(mesh, 0.1);

    EXPECT_EQ(result.domain->region_at({1.0, 0.0, 0.0}), 1);
}

TEST(PrepareSurface, LeavesHolesOpenWhenAsked) {
    auto mesh = some_torus();
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        return (mesh.vertices[static_cast<std::size_t>(t[0])] - Vec3(1.4, 0, 0)).norm() < 0.2;
    });

    const auto result = prepare(mesh, 0.1, {.close_holes = false});

    EXPECT_GT(result.domain->closest({1.4, 0.0, 0.0}).distance, 0.05);
}

TEST(PrepareSurface, GoesOnSmoothlyAcrossWideHoles) {
    auto mesh = some_torus();
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        return (mesh.vertices[static_cast<std::size_t>(t[0])] - Vec3(1.4, 0, 0)).norm() < 0.26;
    });

    const auto result = prepare(mesh, 0.1);

    EXPECT_NEAR(sampled_volume(*result.domain), kTorusVolume, 0.015 * kTorusVolume);
    EXPECT_LT(result.domain->closest({1.4, 0.0, 0.0}).distance, 0.01);
}

/// A torus without what lies at azimuths of less than `angle` from the x axis.
SurfaceMesh cut_torus(double angle) {
    auto mesh = some_torus();
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        const Vec3& v = mesh.vertices[static_cast<std::size_t>(t[0])];
        return std::abs(std::atan2(v[1], v[0])) < angle;
    });
    return mesh;
}

TEST(PrepareSurface, JoinsATubeThatLacksARing) {
    const auto result = prepare(cut_torus(0.3), 0.1);

    EXPECT_NEAR(sampled_volume(*result.domain), kTorusVolume, 0.015 * kTorusVolume);
    EXPECT_LT(result.domain->closest({1.4, 0.0, 0.0}).distance, 0.03);
}

TEST(PrepareSurface, CapsATubesEndsThatFaceNoOther) {
    const double cut = 0.5 * std::numbers::pi;

    const auto result = prepare(cut_torus(cut), 0.1);

    EXPECT_NEAR(sampled_volume(*result.domain), 0.5 * kTorusVolume, 0.05 * kTorusVolume);
    EXPECT_EQ(result.domain->region_at({0.3, 1.0, 0.0}), 0);
    EXPECT_EQ(result.domain->region_at({-0.2, 1.0, 0.0}), 1);
}

}  // namespace
}  // namespace remesh
