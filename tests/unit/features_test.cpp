#include "core/stages/features.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/error.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

FeatureSet features_of(const SurfaceMesh& mesh, double h, const FeatureOptions& options = {}) {
    RunContext run;
    return find_features(prepare_surface(mesh, h, {.smoothing = Smoothing::Off}, run), h, options,
                         run);
}

/// A cone or, with a top radius, a frustum over the unit circle; `sides` flat sides.
SurfaceMesh cone(int sides, double height, double top_radius) {
    SurfaceMesh mesh;
    mesh.vertices = {{0, 0, 0}, {0, 0, height}};
    for (int i = 0; i < sides; ++i) {
        const double angle = 2.0 * std::numbers::pi * i / sides;
        mesh.vertices.emplace_back(std::cos(angle), std::sin(angle), 0.0);
        mesh.vertices.emplace_back(top_radius * std::cos(angle), top_radius * std::sin(angle),
                                   height);
    }
    for (Index i = 0; i < sides; ++i) {
        const Index a = 2 + 2 * i;
        const Index b = 2 + 2 * ((i + 1) % sides);
        mesh.triangles.push_back({0, b, a});
        if (top_radius > 0.0) {
            mesh.triangles.push_back({a, b, b + 1});
            mesh.triangles.push_back({a, b + 1, a + 1});
            mesh.triangles.push_back({1, a + 1, b + 1});
        } else {
            mesh.triangles.push_back({a, b, 1});
        }
    }
    return mesh;
}

TEST(FindFeatures, FindsTwelveEdgesAndEightCornersOfACube) {
    const auto features = features_of(testing::unit_cube(), 0.1);

    EXPECT_EQ(features.curves.size(), 12u);
    EXPECT_EQ(features.corners.size(), 8u);
    for (const auto& curve : features.curves) {
        EXPECT_FALSE(curve.is_closed);
        EXPECT_EQ(curve.points.size(), 2u);
    }
}

TEST(FindFeatures, FindsTheConcaveEdgeOfAnL) {
    const auto features = features_of(testing::l_shape(), 0.1);

    EXPECT_EQ(features.corners.size(), 12u);
    EXPECT_EQ(features.curves.size(), 18u);
}

TEST(FindFeatures, FindsNothingOnASmoothSurface) {
    EXPECT_TRUE(features_of(testing::torus(1.0, 0.4, 60, 30), 0.1).empty());
}

TEST(FindFeatures, MakesARimOneClosedCurveWithoutACorner) {
    const auto features = features_of(cone(40, 1.0, 1.0), 0.1);

    ASSERT_EQ(features.curves.size(), 2u);
    EXPECT_TRUE(features.corners.empty());
    for (const auto& curve : features.curves) {
        EXPECT_TRUE(curve.is_closed);
        EXPECT_EQ(curve.points.size(), 41u);
        EXPECT_EQ(curve.points.front(), curve.points.back());
    }
}

TEST(FindFeatures, TakesTheApexOfAConeForACorner) {
    const auto features = features_of(cone(40, 2.0, 0.0), 0.1);

    EXPECT_EQ(features.curves.size(), 1u);
    ASSERT_EQ(features.corners.size(), 1u);
    EXPECT_EQ(features.corners[0], Vec3(0, 0, 2));
}

TEST(FindFeatures, TakesNoStairsForFeatures) {
    const auto ball = [](const Vec3& x) { return x.norm() < 1.0; };
    const auto mesh =
        testing::voxel_surface(ball, {Vec3::Constant(-1.25), Vec3::Constant(1.25)}, 0.1);

    EXPECT_TRUE(features_of(mesh, 0.12).empty());
}

TEST(FindFeatures, TakesNoRoughSpotForFeatures) {
    auto mesh = testing::torus(1.0, 0.4, 120, 60);
    const auto rough = testing::with_noise(mesh, 0.02, 4);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
        if (mesh.vertices[i].x() > 1.0) {
            mesh.vertices[i] = rough.vertices[i];
        }
    }

    const auto features = features_of(mesh, 0.05);

    EXPECT_EQ(features.curves.size(), 0U);
}

TEST(FindFeatures, TakesNoRimOfAHoleForAFeature) {
    auto mesh = testing::torus(1.0, 0.4, 60, 30);
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        return (mesh.vertices[static_cast<std::size_t>(t[0])] - Vec3(1.4, 0, 0)).norm() < 0.3;
    });

    EXPECT_TRUE(features_of(mesh, 0.1).empty());
}

TEST(FindFeatures, LeavesOutShortSets) {
    EXPECT_TRUE(features_of(testing::unit_cube(), 0.1, {.min_length = 1000.0}).curves.empty());
}

TEST(FindFeatures, FindsNothingWhenTurnedOff) {
    EXPECT_TRUE(features_of(testing::unit_cube(), 0.1, {.detect = false}).empty());
}

TEST(FindFeatures, RefusesOptionsOutOfRange) {
    EXPECT_THROW(validate(FeatureOptions{.sharp_angle = 0.0}), Error);
    EXPECT_THROW(validate(FeatureOptions{.corner_angle = 180.0}), Error);
    EXPECT_THROW(validate(FeatureOptions{.min_length = -1.0}), Error);
}

TEST(ClosestOnCurve, GivesPointTangentAndArc) {
    const FeatureCurve curve{.points = {{0, 0, 0}, {2, 0, 0}, {2, 3, 0}}};

    const auto on_second = closest_on_curve(curve, {2.5, 1.0, 1.0});

    EXPECT_EQ(on_second.point, Vec3(2, 1, 0));
    EXPECT_EQ(on_second.tangent, Vec3(0, 1, 0));
    EXPECT_DOUBLE_EQ(on_second.arc, 3.0);
}

}  // namespace
}  // namespace remesh
