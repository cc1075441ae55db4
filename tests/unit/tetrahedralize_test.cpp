#include "core/stages/tetrahedralize.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <random>
#include <stop_token>

#include "core/error.h"

namespace remesh::testing {
namespace {

Points random_points(std::size_t count, unsigned seed) {
    std::mt19937 engine(seed);
    Points points;
    const auto coordinate = [&] { return static_cast<double>(engine()) / 4294967296.0; };
    for (std::size_t i = 0; i < count; ++i) {
        const double x = coordinate();
        const double y = coordinate();
        points.emplace_back(x, y, coordinate());
    }
    return points;
}

Points grid_points(int side) {
    Points points;
    for (int x = 0; x < side; ++x) {
        for (int y = 0; y < side; ++y) {
            for (int z = 0; z < side; ++z) {
                points.emplace_back(x, y, z);
            }
        }
    }
    return points;
}

double volume_of(const Points& points, const Tet& t) {
    const Vec3& a = points[t[0]];
    return (points[t[1]] - a).dot((points[t[2]] - a).cross(points[t[3]] - a)) / 6.0;
}

double total_volume(const Points& points, const std::vector<Tet>& tets) {
    double sum = 0.0;
    for (const auto& tet : tets) {
        sum += volume_of(points, tet);
    }
    return sum;
}

TetComplex tetrahedralize_on(int threads, const Points& points) {
    RunContext run;
    tbb::task_arena arena(threads);
    return arena.execute([&] { return tetrahedralize(points, run); });
}

ErrorCode error_of(const Points& points, std::stop_token stop = {}) {
    RunContext run(std::move(stop));
    try {
        tetrahedralize(points, run);
    } catch (const Error& error) {
        return error.code();
    }
    return ErrorCode::Internal;
}

TEST(Tetrahedralize, FillsTheConvexHull) {
    Points points = random_points(500, 1);
    for (const double x : {0.0, 1.0}) {
        for (const double y : {0.0, 1.0}) {
            points.emplace_back(x, y, 0.0);
            points.emplace_back(x, y, 1.0);
        }
    }

    const auto complex = tetrahedralize_on(1, points);

    EXPECT_NEAR(total_volume(points, complex.tets), 1.0, 1e-12);
}

TEST(Tetrahedralize, OrientsAllTetsPositivelyEvenOnAGrid) {
    const Points points = grid_points(6);

    const auto complex = tetrahedralize_on(1, points);

    EXPECT_NEAR(total_volume(points, complex.tets), 125.0, 1e-9);
    EXPECT_TRUE(std::all_of(complex.tets.begin(), complex.tets.end(),
                            [&](const Tet& tet) { return volume_of(points, tet) > 0.0; }));
}

TEST(Tetrahedralize, LeavesAllCircumspheresEmpty) {
    const Points points = random_points(120, 3);

    const auto complex = tetrahedralize_on(1, points);

    for (const auto& tet : complex.tets) {
        const Vec3& a = points[tet[0]];
        Eigen::Matrix3d edges;
        for (int i = 0; i < 3; ++i) {
            edges.row(i) = points[tet[static_cast<std::size_t>(i) + 1]] - a;
        }
        const Vec3 centre = edges.partialPivLu().solve(0.5 * edges.rowwise().squaredNorm());
        const double radius = centre.norm();
        for (const auto& point : points) {
            ASSERT_GE((point - a - centre).norm(), radius * (1.0 - 1e-9));
        }
    }
}

TEST(Tetrahedralize, SortsTetsAndStartsEachWithItsSmallestVertex) {
    const auto complex = tetrahedralize_on(1, random_points(300, 4));

    EXPECT_TRUE(std::is_sorted(complex.tets.begin(), complex.tets.end()));
    for (const auto& t : complex.tets) {
        ASSERT_EQ(t[0], *std::min_element(t.begin(), t.end()));
        ASSERT_EQ(t[1], *std::min_element(t.begin() + 1, t.end()));
    }
}

TEST(Tetrahedralize, TellsTheNeighbourAcrossEachFace) {
    const auto complex = tetrahedralize_on(1, random_points(300, 5));

    std::vector<Index> owner;
    std::vector<Index> hull;
    for (std::size_t t = 0; t < complex.tets.size(); ++t) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const Index other = complex.neighbours[t][corner];
            if (other == kNone) {
                hull.push_back(static_cast<Index>(t));
                continue;
            }
            const auto& theirs = complex.tets[other];
            const auto& back = complex.neighbours[other];
            const auto place = std::find(back.begin(), back.end(), static_cast<Index>(t));
            ASSERT_NE(place, back.end());
            for (std::size_t k = 0; k < 4; ++k) {
                const bool is_shared =
                    std::find(theirs.begin(), theirs.end(), complex.tets[t][k]) != theirs.end();
                ASSERT_EQ(is_shared, k != corner);
            }
        }
    }
    EXPECT_EQ(boundary_of(complex.tets, &owner).size(), hull.size());
    EXPECT_EQ(hull, owner);
}

TEST(Tetrahedralize, LeavesCoincidentPointsOutOfAllTetsButTheFirsts) {
    Points points = random_points(100, 6);
    const std::size_t count = points.size();
    for (std::size_t i = 0; i < count; ++i) {
        points.push_back(points[count - 1 - i]);
    }

    const auto twice = tetrahedralize_on(1, points);
    const auto once = tetrahedralize_on(1, random_points(100, 6));

    EXPECT_EQ(twice.tets, once.tets);
    EXPECT_EQ(twice.neighbours, once.neighbours);
}

TEST(Tetrahedralize, GivesTheSameTetsOnAnyNumberOfThreads) {
    const Points points = random_points(3'000, 7);
    const auto expected = tetrahedralize_on(1, points);

    for (const int threads : {2, 3, 8}) {
        const auto actual = tetrahedralize_on(threads, points);
        EXPECT_EQ(actual.tets, expected.tets) << threads << " threads";
        EXPECT_EQ(actual.neighbours, expected.neighbours) << threads << " threads";
    }
}

TEST(Tetrahedralize, RefusesPointsThatSpanNoVolume) {
    Points plane = random_points(50, 8);
    for (auto& point : plane) {
        point.z() = 0.25;
    }

    EXPECT_EQ(error_of(plane), ErrorCode::Unmeshable);
    EXPECT_EQ(error_of({}), ErrorCode::Unmeshable);
    EXPECT_EQ(error_of(random_points(3, 9)), ErrorCode::Unmeshable);
    EXPECT_EQ(error_of(Points(10, Vec3(1.0, 2.0, 3.0))), ErrorCode::Unmeshable);
}

TEST(Tetrahedralize, RefusesPointsThatAreNotFinite) {
    Points points = random_points(50, 10);
    points[20].y() = std::numeric_limits<double>::quiet_NaN();

    EXPECT_EQ(error_of(points), ErrorCode::Unmeshable);
}

TEST(Tetrahedralize, StopsWhenAsked) {
    std::stop_source source;
    source.request_stop();

    EXPECT_EQ(error_of(random_points(50, 11), source.get_token()), ErrorCode::Cancelled);
}

}  // namespace
}  // namespace remesh::testing
