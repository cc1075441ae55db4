#include "core/stages/delaunay_slabs.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stop_token>
#include <vector>

#include "core/error.h"
#include "tests/support/cell_links.h"

namespace remesh::testing {
namespace {

class Numbers {
public:
    explicit Numbers(unsigned seed) : engine_(seed) {}
    double operator()() { return static_cast<double>(engine_()) / 4294967296.0; }
    Vec3 in_cube() {
        const double x = (*this)();
        const double y = (*this)();
        return {x, y, (*this)()};
    }
    Vec3 on_sphere() {
        for (;;) {
            const Vec3 p = 2.0 * in_cube() - Vec3::Ones();
            if (p.norm() > 0.1 && p.norm() < 1.0) {
                return p.normalized();
            }
        }
    }

private:
    std::mt19937 engine_;
};

Points cloud() {
    Numbers random(1);
    Points points(4000);
    std::generate(points.begin(), points.end(), [&] { return random.in_cube(); });
    return points;
}

Points hollow_ball() {
    Numbers random(2);
    Points points(3000);
    std::generate(points.begin(), points.end(),
                  [&] { return Vec3((1.0 + 0.1 * random()) * random.on_sphere()); });
    return points;
}

Points two_balls_far_apart() {
    Numbers random(3);
    Points points(3000);
    std::generate(points.begin(), points.end(), [&, left = false]() mutable {
        left = !left;
        return Vec3(random.on_sphere() * random() + Vec3(left ? -20.0 : 20.0, 0.0, 0.0));
    });
    return points;
}

// Every sphere has eight points.
Points grid() {
    Points points;
    for (int i = 0; i < 14 * 14 * 14; ++i) {
        points.emplace_back(i % 14, i / 14 % 14, i / 196);
    }
    return points;
}

Points cloud_with_repeats() {
    Points points = cloud();
    for (std::size_t i = 0; i < 4000; i += 3) {
        points.push_back(points[i]);
    }
    return points;
}

Points flat() {
    Points points = cloud();
    for (Vec3& p : points) {
        p.z() = 0.5;
    }
    return points;
}

Points far_from_the_origin() {
    Points points = cloud();
    for (Vec3& p : points) {
        p += Vec3(1e6, -1e6, 1e6);
    }
    return points;
}

struct Case {
    const char* name;
    Points (*points)();
};

class DelaunaySlabs : public ::testing::TestWithParam<Case> {};

TEST_P(DelaunaySlabs, AreTheWholeTriangulation) {
    const Points points = GetParam().points();
    const CellLinks expected = links_of(delaunay_cells(points));

    for (const std::size_t slabs : {2U, 3U, 7U}) {
        const TetComplex complex = delaunay_in_slabs(points, slabs, RunContext());
        EXPECT_EQ(complex.tets.size(), expected.size()) << slabs << " slabs";
        EXPECT_EQ(links_of(complex), expected) << slabs << " slabs";
    }
}

INSTANTIATE_TEST_SUITE_P(Of, DelaunaySlabs,
                         ::testing::Values(Case{"ACloud", cloud}, Case{"AHollowBall", hollow_ball},
                                           Case{"TwoBallsFarApart", two_balls_far_apart},
                                           Case{"AGrid", grid},
                                           Case{"ACloudWithRepeats", cloud_with_repeats},
                                           Case{"AFlatCloud", flat},
                                           Case{"ACloudFarFromTheOrigin", far_from_the_origin}),
                         [](const auto& tested) { return tested.param.name; });

TEST(DelaunaySlabs, StopWhenAsked) {
    std::stop_source source;
    source.request_stop();
    const RunContext run(source.get_token());

    try {
        delaunay_in_slabs(cloud(), 2, run);
        FAIL() << "not stopped";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Cancelled);
    }
}

TEST(DelaunaySlabs, PayForManyPointsAndThreadsOnly) {
    const auto slabs_on = [](int threads, std::size_t points) {
        tbb::task_arena arena(threads);
        return arena.execute([&] { return worthwhile_slabs(points); });
    };

    EXPECT_EQ(slabs_on(1, 10'000'000), 1U);
    EXPECT_EQ(slabs_on(8, 10'000), 1U);
    EXPECT_EQ(slabs_on(2, 1'000'000), 2U);
    EXPECT_EQ(slabs_on(8, 10'000'000), 8U);
}

}  // namespace
}  // namespace remesh::testing
