#include "tests/support/shapes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace remesh::testing {
namespace {

// Directed edges without their opposite: zero for a closed, consistently oriented surface.
std::size_t unmatched_edges(const SurfaceMesh& mesh) {
    std::map<std::pair<Index, Index>, int> edges;
    for (const auto& t : mesh.triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
            ++edges[{t[i], t[(i + 1) % 3]}];
            --edges[{t[(i + 1) % 3], t[i]}];
        }
    }
    std::size_t count = 0;
    for (const auto& [edge, balance] : edges) {
        count += balance != 0;
    }
    return count;
}

TEST(Shapes, AreClosedAndConsistentlyOriented) {
    EXPECT_EQ(unmatched_edges(unit_cube()), 0u);
    EXPECT_EQ(unmatched_edges(icosphere(2)), 0u);
    EXPECT_EQ(unmatched_edges(torus(1.0, 0.4, 24, 12)), 0u);
    EXPECT_EQ(unmatched_edges(l_shape()), 0u);
}

TEST(Shapes, LevelSetAndVoxelSurfaceOfABallAreClosed) {
    const Box box{Vec3::Constant(-1.2), Vec3::Constant(1.2)};

    EXPECT_EQ(unmatched_edges(level_set([](const Vec3& x) { return x.norm() - 1.0; }, box, 0.2)),
              0u);
    EXPECT_EQ(
        unmatched_edges(voxel_surface([](const Vec3& x) { return x.norm() < 1.0; }, box, 0.2)), 0u);
}

}  // namespace
}  // namespace remesh::testing
