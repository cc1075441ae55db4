#include "core/stages/improve/boundary_guard.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace remesh::improve {
namespace {

// A tet that stands on its tip just above another one, of which only that tip may move.
class BoundaryGuardTest : public ::testing::Test {
protected:
    TetMesh mesh_{.vertices = {{0, 0, 0},
                               {1, 0, 0},
                               {0, 1, 0},
                               {0.2, 0.2, -1},
                               {0.2, 0.2, 0.5},
                               {0, 0, 2},
                               {1, 0, 2},
                               {0, 1, 2}},
                  .tets = {{0, 2, 1, 3}, {4, 5, 6, 7}}};
    std::vector<ParticleKind> kind_ = std::vector<ParticleKind>(8, ParticleKind::Surface);
    std::vector<Index> anchor_ = std::vector<Index>(8, kNone);
    Whole whole_{mesh_, kind_, anchor_};
    Part part_ = cut_part(whole_, around(whole_, {0, 0, 0, 0, 1, 0, 0, 0}));
    BoundaryGuard guard_{whole_, part_};
    Index tip_ = index(static_cast<std::size_t>(
        std::find(part_.origin.begin(), part_.origin.end(), 4) - part_.origin.begin()));
};

TEST_F(BoundaryGuardTest, AllowsWhatCrossesNothing) {
    ASSERT_EQ(part_.mesh.slot_count(), 1U);
    part_.mesh.move(tip_, {0.2, 0.2, 0.01}, kNone);
    EXPECT_TRUE(guard_.allows(part_.mesh, {0}));
}

TEST_F(BoundaryGuardTest, SeesFacesOutsideOfThePart) {
    part_.mesh.move(tip_, {0.2, 0.2, -0.01}, kNone);
    EXPECT_FALSE(guard_.allows(part_.mesh, {0}));
}

TEST_F(BoundaryGuardTest, TakesTouchingForCrossing) {
    part_.mesh.move(tip_, {0.2, 0.2, 0.0}, kNone);
    EXPECT_FALSE(guard_.allows(part_.mesh, {0}));
}

TEST_F(BoundaryGuardTest, SeesOtherFacesOfThePart) {
    // A tet as a split might have put it there, first beside the other and then through it.
    const Index a = part_.mesh.add_vertex({2, 2, 1}, ParticleKind::Surface, kNone, false);
    const Index b = part_.mesh.add_vertex({3, 3, 1}, ParticleKind::Surface, kNone, false);
    const Index c = part_.mesh.add_vertex({3, 4, 1}, ParticleKind::Surface, kNone, false);
    const Index d = part_.mesh.add_vertex({3, 3, 1.2}, ParticleKind::Surface, kNone, false);
    const Index other = part_.mesh.add({a, b, c, d});
    EXPECT_TRUE(guard_.allows(part_.mesh, {other}));
    part_.mesh.move(a, {-1, -1, 1}, kNone);
    EXPECT_FALSE(guard_.allows(part_.mesh, {other}));
}

}  // namespace
}  // namespace remesh::improve
