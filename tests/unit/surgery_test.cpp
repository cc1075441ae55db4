#include "core/stages/improve/surgery.h"

#include <gtest/gtest.h>

#include "tests/support/analytic_domain.h"

namespace remesh::improve {
namespace {

constexpr Index kDimple = 0;

// Three tets under a dimple of some depth in the top of a box, at z = 4.
LiveMesh dimpled(double depth) {
    LiveMesh mesh;
    mesh.add_vertex({2.0, 2.0, 4.0 - depth}, ParticleKind::Surface, 0, false);
    for (const Vec3& x : {Vec3(1, 1, 4), Vec3(3, 1, 4), Vec3(2, 3, 4), Vec3(2, 2, 2)}) {
        mesh.add_vertex(x, ParticleKind::Surface, 0, false);
    }
    for (const Tet& tet : {Tet{4, 1, 2, kDimple}, Tet{4, 2, 3, kDimple}, Tet{4, 3, 1, kDimple}}) {
        mesh.append_tet(tet);
    }
    mesh.build_incidence();
    return mesh;
}

class LevelVertexTest : public ::testing::Test {
protected:
    testing::BoxDomain box_{Vec3(4, 4, 4)};
    FeatureSet features_ = box_.features();
    Shape shape_{box_, features_};
};

TEST_F(LevelVertexTest, FreesTheVertexThatItBuries) {
    auto mesh = dimpled(0.3);
    ASSERT_TRUE(level_vertex(mesh, shape_, kDimple));
    EXPECT_EQ(mesh.kind(kDimple), ParticleKind::Volume);
    EXPECT_EQ(mesh.around(kDimple).size(), 4U);
}

TEST_F(LevelVertexTest, CanBeRolledBack) {
    auto mesh = dimpled(0.3);
    mesh.begin();
    ASSERT_TRUE(level_vertex(mesh, shape_, kDimple));
    mesh.roll_back();
    EXPECT_EQ(mesh.kind(kDimple), ParticleKind::Surface);
    EXPECT_EQ(mesh.anchor(kDimple), 0);
    EXPECT_EQ(mesh.around(kDimple).size(), 3U);
}

TEST_F(LevelVertexTest, TakesOffABump) {
    auto mesh = dimpled(0.3);
    ASSERT_TRUE(level_vertex(mesh, shape_, kDimple));
    // What was laid on is now the only tet at a vertex of its own.
    const Index peak = mesh.add_vertex({2.0, 2.0, 4.4}, ParticleKind::Surface, 0, false);
    const Index bump = mesh.add({1, 2, 3, peak});
    ASSERT_TRUE(level_vertex(mesh, shape_, peak));
    EXPECT_FALSE(mesh.is_alive(bump));
    EXPECT_TRUE(mesh.around(peak).empty());
}

// Two tets across the gap between two bodies: nothing there follows the boundary.
TEST(PeelEdge, TakesOffAWebThatLeavesTheBoundaryAnyway) {
    const testing::BoxDomain box({4, 4, 4});
    const FeatureSet features;
    const Shape shape{box, features};
    LiveMesh mesh;
    // The edge (0, 1) hangs in the air, two high above the top.
    for (const Vec3& x :
         {Vec3(1, 2, 6), Vec3(3, 2, 6), Vec3(2, 1, 4), Vec3(2, 3, 4), Vec3(2, 2, 2)}) {
        mesh.add_vertex(x, ParticleKind::Surface, 0, false);
    }
    for (Tet tet : {Tet{0, 1, 2, 3}, Tet{0, 2, 3, 4}, Tet{1, 2, 3, 4}}) {
        const Vec3& a = mesh.point(tet[0]);
        if ((mesh.point(tet[1]) - a).dot((mesh.point(tet[2]) - a).cross(mesh.point(tet[3]) - a)) <
            0.0) {
            std::swap(tet[2], tet[3]);
        }
        mesh.append_tet(tet);
    }
    mesh.build_incidence();

    EXPECT_TRUE(peel_edge(mesh, shape, 0, 1));
    EXPECT_FALSE(mesh.is_alive(0));
}

}  // namespace
}  // namespace remesh::improve
