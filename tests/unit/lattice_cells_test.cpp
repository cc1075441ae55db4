#include "core/stages/lattice_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/stages/tetrahedralize.h"
#include "tests/support/cell_links.h"

namespace remesh::testing {
namespace {

constexpr int kSide = 6;  // Cells.
constexpr std::size_t kTetsOfACell = 46;

class Numbers {
public:
    /// In [-1, 1).
    double operator()() { return static_cast<double>(engine_()) / 2147483648.0 - 1.0; }
    Vec3 vector() {
        const double x = (*this)();
        const double y = (*this)();
        return {x, y, (*this)()};
    }

private:
    std::mt19937 engine_{7};
};

/// All sites of some cells, stirred by up to `amount` of a cell.
Points block(const Lattice& lattice, double amount) {
    Numbers random;
    Points points;
    for (int c = 0; c < kSide * kSide * kSide; ++c) {
        const Vec3 corner(c % kSide, c / kSide % kSide, c / kSide / kSide);
        for (const Vec3& site : kA15Sites) {
            points.push_back(lattice.origin +
                             lattice.cell * (corner + site + amount * random.vector()));
        }
    }
    return points;
}

constexpr double kStir = 5e-5;

Lattice plain() {
    return {Vec3::Zero(), 1.0};
}

Lattice far_and_small() {
    return {Vec3(-1e4, 1e4, 2.5e3), 0.37};
}

struct Case {
    const char* name;
    Lattice (*lattice)();
    void (*change)(Points&);
};

void leave(Points&) {}

void move_some(Points& points) {
    Numbers random;
    for (std::size_t i = 0; i < points.size(); i += 7) {
        points[i] += 0.3 * random.vector();
    }
}

void move_all_a_little(Points& points) {
    Numbers random;
    for (Vec3& p : points) {
        p += 0.0028 * random.vector();
    }
}

void drop_some(Points& points) {
    Points kept;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (i % 5 != 0) {
            kept.push_back(points[i]);
        }
    }
    points = kept;
}

void add_some(Points& points) {
    Numbers random;
    for (int i = 0; i < 200; ++i) {
        points.push_back(0.5 * kSide * (random.vector() + Vec3::Ones()));
    }
}

void repeat_some(Points& points) {
    const std::size_t n = points.size();
    for (std::size_t i = 0; i < n; i += 9) {
        points.push_back(points[i]);
    }
}

void add_one_far_away(Points& points) {
    points.emplace_back(1e9, 0.0, 0.0);
}

void turn(Points& points) {
    for (Vec3& p : points) {
        p = Vec3(0.6 * p.x() - 0.8 * p.y(), 0.8 * p.x() + 0.6 * p.y(), p.z());
    }
}

class LatticeCells : public ::testing::TestWithParam<Case> {};

TEST_P(LatticeCells, AreCompletedToTheWholeTriangulation) {
    const Lattice lattice = GetParam().lattice();
    Points points = block(lattice, kStir);
    GetParam().change(points);
    RunContext run;

    const TetComplex with = tetrahedralize(points, run, lattice);
    const TetComplex without = tetrahedralize(points, run);

    EXPECT_EQ(with.tets, without.tets);
    EXPECT_EQ(with.neighbours, without.neighbours);
}

TEST_P(LatticeCells, AreAmongTheDelaunayTets) {
    const Lattice lattice = GetParam().lattice();
    Points points = block(lattice, kStir);
    GetParam().change(points);
    const CellLinks all = links_of(delaunay_cells(points));
    const Tet none{kNone, kNone, kNone, kNone};

    const CellLinks found = links_of(lattice_cells(points, lattice, RunContext()));

    for (const auto& [tet, neighbours] : found) {
        ASSERT_TRUE(all.contains(tet));
        for (std::size_t k = 0; k < 4; ++k) {
            ASSERT_TRUE(neighbours[k] == none || neighbours[k] == all.at(tet)[k]);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Of, LatticeCells,
                         ::testing::Values(Case{"ABlock", plain, leave},
                                           Case{"ABlockElsewhere", far_and_small, leave},
                                           Case{"SomeMoved", plain, move_some},
                                           Case{"AllMovedALittle", plain, move_all_a_little},
                                           Case{"SomeMissing", plain, drop_some},
                                           Case{"SomeAmongThem", plain, add_some},
                                           Case{"SomeTwice", plain, repeat_some},
                                           Case{"OneFarAway", plain, add_one_far_away},
                                           Case{"ATurnedBlock", plain, turn}),
                         [](const auto& tested) { return tested.param.name; });

TEST(LatticeCells, FillAllButTheRimOfABlock) {
    const Points points = block(plain(), kStir);

    const auto inner = static_cast<std::size_t>((kSide - 2) * (kSide - 2) * (kSide - 2));
    EXPECT_GT(lattice_cells(points, plain(), RunContext()).tets.size(), inner * kTetsOfACell);
}

}  // namespace
}  // namespace remesh::testing
