#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/error.h"
#include "core/geometry/bvh.h"
#include "core/geometry/domain_volume.h"
#include "core/geometry/edge_table.h"
#include "core/geometry/mollified_winding.h"
#include "core/geometry/spline_surface.h"
#include "core/geometry/surface_domain.h"
#include "core/geometry/winding_number.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

using testing::icosphere;
using testing::torus;
using testing::unit_cube;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double hashed(unsigned i) {  // In [-1.5, 1.5).
    const double x = std::sin(static_cast<double>(i) * 12.9898) * 43758.5453;
    return 3.0 * (x - std::floor(x)) - 1.5;
}

Points scattered(unsigned count) {
    Points points;
    for (unsigned i = 0; i < count; ++i) {
        points.emplace_back(hashed(3 * i), hashed(3 * i + 1), hashed(3 * i + 2));
    }
    return points;
}

double exact_winding_number(const SurfaceMesh& mesh, const Vec3& p) {
    double sum = 0.0;
    for (const auto& t : mesh.triangles) {
        const auto corner = [&](std::size_t k) {
            return mesh.vertices[static_cast<std::size_t>(t[k])];
        };
        sum += solid_angle(p, corner(0), corner(1), corner(2));
    }
    return sum / (4.0 * std::numbers::pi);
}

double exact_distance2(const SurfaceMesh& mesh, const Vec3& p) {
    double best = kInfinity;
    for (const auto& t : mesh.triangles) {
        const auto corner = [&](std::size_t k) {
            return mesh.vertices[static_cast<std::size_t>(t[k])];
        };
        const Vec3 q = closest_on_triangle(p, corner(0), corner(1), corner(2));
        best = std::min(best, (q - p).squaredNorm());
    }
    return best;
}

TEST(Bvh, FindsTheSameDistanceAsAllTriangles) {
    const auto mesh = torus(1.0, 0.4, 40, 20);
    const Bvh bvh(mesh.vertices, mesh.triangles);

    for (const auto& p : scattered(500)) {
        EXPECT_EQ(bvh.closest(p, kInfinity)->distance2, exact_distance2(mesh, p));
    }
}

TEST(Bvh, GivesTheSameDistanceFromAnyHint) {
    const auto mesh = torus(1.0, 0.4, 40, 20);
    const Bvh bvh(mesh.vertices, mesh.triangles);

    for (const auto& p : scattered(50)) {
        const auto cold = bvh.closest(p, kInfinity);
        for (Index hint = 0; hint < 1600; hint += 123) {
            EXPECT_EQ(bvh.closest(p, kInfinity, hint)->distance2, cold->distance2);
        }
    }
}

TEST(Bvh, FindsNothingBeyondTheRadius) {
    const auto mesh = unit_cube();
    const Bvh bvh(mesh.vertices, mesh.triangles);

    EXPECT_FALSE(bvh.closest({2.0, 0.5, 0.5}, 0.999).has_value());
    EXPECT_TRUE(bvh.closest({2.0, 0.5, 0.5}, 1.001).has_value());
}

TEST(Bvh, HitsTheFirstTriangleThatIsAccepted) {
    const auto mesh = unit_cube();
    const Bvh bvh(mesh.vertices, mesh.triangles);
    const Vec3 origin(-1.0, 0.3, 0.4);

    const auto any =
        bvh.first_hit(origin, Vec3::UnitX(), 0.0, 10.0, [](double, Index) { return true; });
    const auto later =
        bvh.first_hit(origin, Vec3::UnitX(), 0.0, 10.0, [](double t, Index) { return t > 1.5; });
    const auto none =
        bvh.first_hit(origin, Vec3::UnitY(), 0.0, 10.0, [](double, Index) { return true; });

    ASSERT_TRUE(any && later);
    EXPECT_DOUBLE_EQ(any->t, 1.0);
    EXPECT_DOUBLE_EQ(later->t, 2.0);
    EXPECT_FALSE(none);
}

TEST(Bvh, IsEmptyWithoutTriangles) {
    const Bvh bvh({}, {});

    EXPECT_FALSE(bvh.closest(Vec3::Zero(), kInfinity).has_value());
}

TEST(Bvh, CopesWithTrianglesThatShareOneCentroid) {
    SurfaceMesh mesh;
    for (Index i = 0; i < 300; ++i) {
        mesh.vertices.insert(mesh.vertices.end(), {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)});
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const Bvh bvh(mesh.vertices, mesh.triangles);

    EXPECT_DOUBLE_EQ(bvh.closest({0.2, 0.2, 1.0}, kInfinity)->distance2, 1.0);
}

TEST(SolidAngle, OfACubeFaceFromTheMiddleIsASixthOfTheSphere) {
    const Vec3 p(0.0, 0.0, 0.0);
    const double half = solid_angle(p, {1, -1, -1}, {1, 1, -1}, {1, 1, 1}) +
                        solid_angle(p, {1, -1, -1}, {1, 1, 1}, {1, -1, 1});

    EXPECT_NEAR(half, 4.0 * std::numbers::pi / 6.0, 1e-12);
}

TEST(WindingNumber, AgreesWithTheSumOfAllSolidAngles) {
    const auto mesh = torus(1.0, 0.4, 60, 30);
    const WindingNumber winding(mesh.vertices, mesh.triangles);

    for (const auto& p : scattered(1000)) {
        EXPECT_NEAR(winding.at(p), exact_winding_number(mesh, p), 0.03);
    }
}

TEST(WindingNumber, AgreesWithTheSumOnSoupWithHoles) {
    const auto mesh =
        testing::as_soup(testing::with_triangles_removed(torus(1.0, 0.4, 60, 30), 0.2, 1));
    const WindingNumber winding(mesh.vertices, mesh.triangles);

    for (const auto& p : scattered(1000)) {
        EXPECT_NEAR(winding.at(p), exact_winding_number(mesh, p), 0.03);
    }
}

TEST(WindingNumber, IsTwoWherePartsOverlap) {
    const auto mesh = testing::join(
        unit_cube(), testing::transformed(unit_cube(), Eigen::Matrix3d::Identity(), {0.5, 0, 0}));
    const WindingNumber winding(mesh.vertices, mesh.triangles);

    EXPECT_NEAR(winding.at({0.75, 0.5, 0.5}), 2.0, 1e-4);
    EXPECT_NEAR(winding.at({0.25, 0.5, 0.5}), 1.0, 1e-4);
    EXPECT_NEAR(winding.at({1.75, 0.5, 0.5}), 0.0, 1e-4);
}

TEST(WindingNumber, DoesNotDependOnScaleAndPlace) {
    const auto mesh = torus(1.0, 0.4, 40, 20);
    const auto moved =
        testing::transformed(mesh, 1e-6 * Eigen::Matrix3d::Identity(), Vec3(3.0, -2.0, 1.0));
    const WindingNumber winding(mesh.vertices, mesh.triangles);
    const WindingNumber of_moved(moved.vertices, moved.triangles);

    for (const auto& p : scattered(200)) {
        EXPECT_NEAR(of_moved.at(1e-6 * p + Vec3(3.0, -2.0, 1.0)), winding.at(p), 1e-3);
    }
}

TEST(MollifiedWinding, LeavesASphereInPlace) {
    const auto mesh = icosphere(4);
    const WindingNumber winding(mesh.vertices, mesh.triangles);
    const MollifiedWinding field(winding);

    for (const Vec3& direction : {Vec3(1, 0, 0), Vec3(0.6, 0.8, 0.0), Vec3(0.48, 0.6, -0.64)}) {
        const auto sample = field.at(direction, 0.3);
        const auto place = field.project(direction, sample, 0.3, 0.2);

        ASSERT_TRUE(place);
        EXPECT_NEAR(place->point.norm(), 1.0, 0.006);
        EXPECT_GT(place->normal.dot(direction), 0.999);
    }
}

TEST(MollifiedWinding, IsTheWindingNumberAwayFromTheSurface) {
    const auto mesh = icosphere(3);
    const WindingNumber winding(mesh.vertices, mesh.triangles);
    const MollifiedWinding field(winding);

    EXPECT_NEAR(field.at({0.2, 0.1, 0.0}, 0.3).value, 1.0, 0.02);
    EXPECT_NEAR(field.at({1.6, 0.1, 0.0}, 0.3).value, 0.0, 0.02);
    EXPECT_NEAR(field.at({0.2, 0.1, 0.0}, 0.3).gradient.norm(), 0.0, 1e-9);
}

TEST(MollifiedWinding, HasTheGradientOfItsValue) {
    const auto mesh = torus(1.0, 0.4, 60, 30);
    const WindingNumber winding(mesh.vertices, mesh.triangles);
    const MollifiedWinding field(winding);
    const Vec3 p(1.38, 0.1, 0.05);

    const auto gradient = field.at(p, 0.25).gradient;

    for (Eigen::Index d = 0; d < 3; ++d) {
        const Vec3 step = 0.02 * Vec3::Unit(d);
        const double slope =
            (field.at(p + step, 0.25).value - field.at(p - step, 0.25).value) / 0.04;
        EXPECT_NEAR(gradient[d], slope, 0.35);
    }
}

TEST(SurfaceDomain, TellsInsideFromOutside) {
    const SurfaceDomain domain(icosphere(4));

    EXPECT_EQ(domain.region_at({0.0, 0.0, 0.0}), 1);
    EXPECT_EQ(domain.region_at({0.98, 0.0, 0.0}), 1);
    EXPECT_EQ(domain.region_at({1.02, 0.0, 0.0}), 0);
    EXPECT_EQ(domain.region_at({100.0, 0.0, 0.0}), 0);
}

TEST(SurfaceDomain, IsInsideJustBehindItsBoundaryAndOutsideJustInFront) {
    const SurfaceDomain domain(torus(1.0, 0.4, 60, 30));

    for (const auto& p : scattered(500)) {
        const auto nearest = domain.closest(p);
        EXPECT_EQ(domain.region_at(nearest.point - 1e-3 * nearest.normal), 1);
        EXPECT_EQ(domain.region_at(nearest.point + 1e-3 * nearest.normal), 0);
    }
}

TEST(SurfaceDomain, InterpolatesGivenNormals) {
    auto sphere = icosphere(2);
    const Points normals = sphere.vertices;
    const SurfaceDomain domain(std::move(sphere), normals);

    for (const auto& p : scattered(100)) {
        const auto nearest = domain.closest(p);
        EXPECT_GT(nearest.normal.dot(nearest.point.normalized()), 0.9999);
    }
}

TEST(SurfaceDomain, RefusesPointsThatArentAnywhere) {
    const SurfaceDomain domain(unit_cube());

    for (const double x : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(), -1e300}) {
        EXPECT_THROW(static_cast<void>(domain.closest(Vec3(x, 0.5, 0.5))), Error);
        EXPECT_FALSE(domain.closest_within(Vec3(x, 0.5, 0.5), 1.0));
    }
}

TEST(SurfaceDomain, FindsTheOppositeWall) {
    const SurfaceDomain domain(unit_cube());
    const Vec3 top(0.3, 0.4, 1.0);

    const auto thickness = domain.first_hit(top, -Vec3::UnitZ(), 1e-6, 10.0, Vec3::UnitZ(), -0.3);

    ASSERT_TRUE(thickness);
    EXPECT_DOUBLE_EQ(*thickness, 1.0);
}

TEST(VolumeInside, IsRightWhereTheBoundaryHasGaps) {
    const SurfaceDomain domain(testing::with_triangles_removed(icosphere(4), 0.02, 1), {});

    EXPECT_NEAR(volume_inside(domain, 0.05, RunContext()), 4.0 / 3.0 * std::numbers::pi, 0.02);
}

TEST(SplineSurface, MakesAPlaneOfFlatPoints) {
    const Points points{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}, {3, 2, 1}};

    const auto spline = SplineSurface::through(points, Points(5, Vec3::UnitZ()), 0.0);

    ASSERT_TRUE(spline.has_value());
    EXPECT_NEAR(spline->at({7.0, -5.0, 1.0}), 0.0, 1e-9);
    EXPECT_NEAR(spline->at({0.3, 0.2, 3.5}), 2.5, 1e-9);
}

TEST(SplineSurface, GoesOnAlongASphereWhereThereAreNoPoints) {
    Points points;
    for (const Vec3& v : icosphere(2).vertices) {
        if (v.z() < 0.7) {
            points.push_back(v);
        }
    }

    const auto spline = SplineSurface::through(points, points, 0.0);

    ASSERT_TRUE(spline.has_value());
    EXPECT_NEAR(spline->at(points.front()), 0.0, 1e-9);
    EXPECT_NEAR(spline->at(Vec3(0.0, 0.0, 1.0)), 0.0, 0.02);
    EXPECT_LT(spline->at(Vec3(0.1, 0.0, 0.9)), 0.0);
    EXPECT_GT(spline->at(Vec3(0.1, 0.0, 1.1)), 0.0);
}

TEST(SplineSurface, NeedsFourPoints) {
    EXPECT_FALSE(SplineSurface::through(Points(3, Vec3::UnitX()), Points(3, Vec3::UnitX()), 0.0));
}

TEST(EdgeTable, HasEachEdgeOfACubeOnceWithTwoTriangles) {
    const auto cube = unit_cube();
    const EdgeTable table(cube.triangles, cube.vertices.size());

    EXPECT_EQ(table.edges().size(), 18u);
    for (const auto& edge : table.edges()) {
        EXPECT_EQ(edge.count, 2);
        EXPECT_LT(edge.low, edge.high);
        for (const auto half : table.half_edges(edge)) {
            EXPECT_EQ(&table.edge_of(half), &edge);
        }
    }
}

}  // namespace
}  // namespace remesh
