#include "core/mesh/mesh.h"

#include <gtest/gtest.h>

#include "core/mesh/preview.h"
#include "core/mesh/quality.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

// Two tets on both sides of the triangle (0, 1, 2); vertex 5 is used by none.
TetMesh two_tets() {
    TetMesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}, {9, 9, 9}};
    mesh.tets = {{0, 1, 2, 3}, {0, 2, 1, 4}};
    return mesh;
}

TEST(Boundary, LeavesOutTheSharedFaceAndTellsTheOwners) {
    const auto mesh = two_tets();
    std::vector<Index> owner;

    const auto triangles = boundary_of(mesh.tets, &owner);

    EXPECT_EQ(triangles.size(), 6u);
    EXPECT_EQ(owner, (std::vector<Index>{0, 0, 0, 1, 1, 1}));
}

TEST(Boundary, FacesOutwardAndEnclosesTheVolumeOfTheTets) {
    const auto surface = boundary_surface(two_tets());

    EXPECT_EQ(surface.vertices.size(), 5u);
    EXPECT_NEAR(enclosed_volume(surface), 1.0 / 3.0, 1e-12);
}

TEST(BoundingBox, OfNothingIsEmpty) {
    EXPECT_TRUE(bounding_box({}).is_empty());
    EXPECT_DOUBLE_EQ(bounding_box({}).diagonal(), 0.0);
    EXPECT_FALSE(bounding_box({Vec3::Zero()}).is_empty());
}

TEST(Decimate, KeepsASmallSurfaceAsItIs) {
    const auto sphere = testing::icosphere(1);

    EXPECT_EQ(decimate(sphere).triangles, sphere.triangles);
}

TEST(Decimate, ReachesTheTargetAndKeepsTheShape) {
    const auto sphere = testing::icosphere(5);

    const auto coarse = decimate(sphere, 1000);

    EXPECT_LE(coarse.triangles.size(), 1000u);
    EXPECT_GE(coarse.triangles.size(), 900u);
    EXPECT_NEAR(enclosed_volume(coarse), enclosed_volume(sphere), 0.02 * enclosed_volume(sphere));
}

TEST(Decimate, SurvivesANonManifoldSurface) {
    auto sphere = testing::icosphere(3);
    sphere.triangles.push_back({0, 5, 40});
    sphere.triangles.push_back(sphere.triangles.front());

    EXPECT_LE(decimate(sphere, 300).triangles.size(), 300u);
}

TEST(Cluster, KeepsASmallSurfaceAsItIs) {
    const auto sphere = testing::icosphere(1);

    EXPECT_EQ(cluster(sphere).triangles, sphere.triangles);
}

TEST(Cluster, ComesNearTheTargetAndKeepsTheShape) {
    const auto sphere = testing::icosphere(5);

    const auto coarse = cluster(sphere, 1000);

    EXPECT_LE(coarse.triangles.size(), 1000u);
    EXPECT_GE(coarse.triangles.size(), 500u);
    EXPECT_NEAR(enclosed_volume(coarse), enclosed_volume(sphere), 0.05 * enclosed_volume(sphere));
}

}  // namespace
}  // namespace remesh
