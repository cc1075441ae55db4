#include "core/stages/verify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <limits>
#include <random>
#include <stop_token>

#include "core/error.h"
#include "core/exact/intersections.h"
#include "tests/support/shapes.h"

namespace remesh::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

const Eigen::Matrix3d kSame = Eigen::Matrix3d::Identity();

SurfaceMesh tetrahedron(const Vec3& shift = Vec3::Zero()) {
    return {
        .vertices = {shift, shift + Vec3::UnitX(), shift + Vec3::UnitY(), shift + Vec3::UnitZ()},
        .triangles = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
}

// Makes vertex b of a surface the same as vertex a.
SurfaceMesh welded(SurfaceMesh surface, Index a, Index b) {
    for (auto& triangle : surface.triangles) {
        for (auto& v : triangle) {
            v = v == b ? a : v;
        }
    }
    return surface;
}

// Faults as (open, non-manifold edges, non-manifold vertices, inconsistent, inverted, degenerate,
// overlapping, intersections).
std::vector<std::int64_t> counts(const Faults& faults) {
    return {faults.open_edges,
            faults.non_manifold_edges,
            faults.non_manifold_vertices,
            faults.inconsistent_edges,
            faults.inverted_tets,
            faults.degenerate_triangles,
            faults.overlapping_tets,
            static_cast<std::int64_t>(faults.intersections.size())};
}

Faults check(const SurfaceMesh& surface) {
    return check_surface(surface, RunContext());
}

Faults check(const TetMesh& mesh) {
    return check_tets(mesh, RunContext());
}

TEST(CheckSurface, PassesGoodSurfaces) {
    EXPECT_EQ(check(unit_cube()).summary(), "no faults");
    EXPECT_EQ(check(icosphere(3)).summary(), "no faults");
    EXPECT_EQ(check(torus(1.0, 0.4, 24, 12)).summary(), "no faults");
    EXPECT_EQ(check(l_shape()).summary(), "no faults");
    EXPECT_FALSE(check(unit_cube()).any());
}

TEST(CheckSurface, PassesNestedAndSeparateSurfaces) {
    const auto far = transformed(unit_cube(), kSame, Vec3(2.0, 0.0, 0.0));
    const auto within = transformed(unit_cube(), 0.5 * kSame, Vec3::Constant(0.25));

    EXPECT_EQ(check(join(unit_cube(), far)).summary(), "no faults");
    EXPECT_EQ(check(join(unit_cube(), within)).summary(), "no faults");
}

TEST(CheckSurface, FindsOpenEdges) {
    auto surface = tetrahedron();
    surface.triangles.pop_back();

    const auto faults = check(surface);

    EXPECT_THAT(counts(faults), ElementsAre(3, 0, 0, 0, 0, 0, 0, 0));
    EXPECT_THAT(faults.fault_vertices, ElementsAre(0, 1, 2));
    EXPECT_EQ(faults.summary(), "3 open edges");
    EXPECT_TRUE(faults.any());
}

TEST(CheckSurface, FindsEdgesOfMoreThanTwoTriangles) {
    // A mirrored copy below, joined along the edge from vertex 0 to vertex 1.
    auto surface = join(tetrahedron(), transformed(tetrahedron(), -kSame, Vec3::UnitX()));
    surface = welded(welded(surface, 1, 4), 0, 5);
    for (std::size_t i = 4; i < 8; ++i) {
        std::swap(surface.triangles[i][0], surface.triangles[i][1]);
    }

    const auto faults = check(surface);

    EXPECT_THAT(counts(faults), ElementsAre(0, 1, 0, 0, 0, 0, 0, 0));
    EXPECT_THAT(faults.fault_vertices, ElementsAre(0, 1));
}

TEST(CheckSurface, FindsVerticesOfTwoFans) {
    auto surface = join(tetrahedron(), transformed(tetrahedron(), -kSame, Vec3::Zero()));
    surface = welded(surface, 0, 4);
    for (std::size_t i = 4; i < 8; ++i) {
        std::swap(surface.triangles[i][0], surface.triangles[i][1]);
    }

    const auto faults = check(surface);

    EXPECT_THAT(counts(faults), ElementsAre(0, 0, 1, 0, 0, 0, 0, 0));
    EXPECT_THAT(faults.fault_vertices, ElementsAre(0));
    EXPECT_EQ(faults.summary(), "1 non-manifold vertex");
}

TEST(CheckSurface, FindsEdgesRunThroughTwiceInOneDirection) {
    auto surface = tetrahedron();
    std::swap(surface.triangles[0][0], surface.triangles[0][1]);

    EXPECT_THAT(counts(check(surface)), ElementsAre(0, 0, 0, 3, 0, 0, 0, 0));
}

TEST(CheckSurface, FindsDegenerateTriangles) {
    auto flat = unit_cube();
    flat.vertices.emplace_back(5.0, 5.0, 5.0);
    flat.triangles.push_back({8, 8, 8});
    auto thin = tetrahedron();
    thin.vertices[3] = Vec3(0.5, 0.5 + 1e-12, 0.0);
    auto undefined = tetrahedron();
    undefined.vertices[3].x() = std::numeric_limits<double>::quiet_NaN();

    EXPECT_THAT(counts(check(flat)), ElementsAre(0, 0, 0, 0, 0, 1, 0, 0));
    EXPECT_EQ(check(thin).degenerate_triangles, 1);
    EXPECT_EQ(check(undefined).degenerate_triangles, 3);
}

TEST(CheckSurface, FindsWhereTrianglesCross) {
    const auto two = join(tetrahedron(), tetrahedron(Vec3(0.25, 0.125, -0.5)));

    const auto faults = check(two);

    EXPECT_GT(faults.intersections.size(), 0u);
    for (const auto& [a, b] : faults.intersections) {
        EXPECT_LT(a, 4);
        EXPECT_GE(b, 4);
    }
    auto without = faults;
    without.intersections.clear();
    EXPECT_FALSE(without.any());
}

TEST(CheckSurface, CountsTouchingAsIntersection) {
    const auto at_vertex = join(tetrahedron(), transformed(tetrahedron(), -kSame, Vec3::Zero()));
    const auto at_face =
        join(tetrahedron(), transformed(tetrahedron(), -0.125 * kSame, Vec3(0.25, 0.25, 0.0)));

    // Three triangles of one against three of the other, although no indices are shared.
    EXPECT_EQ(check(at_vertex).intersections.size(), 9u);
    EXPECT_TRUE(check(at_face).any());
}

TEST(CheckSurface, FindsTrianglesFoldedOntoEachOther) {
    SurfaceMesh fold{
        .vertices = {Vec3::Zero(), Vec3::UnitX(), Vec3(0.25, 1.0, 0.0), Vec3(0.5, 0.5, 0.0)},
        .triangles = {{0, 1, 2}, {1, 0, 3}}};
    auto flat = fold;
    flat.vertices[3].y() = -0.5;

    EXPECT_THAT(check(fold).intersections, ElementsAre(std::pair<Index, Index>(0, 1)));
    EXPECT_THAT(check(flat).intersections, IsEmpty());
}

TEST(SelfIntersections, AgreeWithEachPairOnItsOwn) {
    std::mt19937 engine(1);
    const auto coordinate = [&] { return static_cast<double>(engine() % 9); };
    SurfaceMesh soup;
    for (Index i = 0; i < 90; ++i) {
        const double x = coordinate();
        const double y = coordinate();
        soup.vertices.emplace_back(x, y, coordinate());
    }
    for (int i = 0; i < 150; ++i) {
        const auto a = static_cast<Index>(engine() % 90);
        const auto b = static_cast<Index>((a + 1 + engine() % 5) % 90);
        soup.triangles.push_back({a, b, static_cast<Index>((a + 6 + engine() % 20) % 90)});
    }

    std::vector<std::pair<Index, Index>> expected;
    for (Index i = 0; i < 150; ++i) {
        for (Index j = i + 1; j < 150; ++j) {
            if (!self_intersections(soup.vertices, {soup.triangles[i], soup.triangles[j]})
                     .empty()) {
                expected.emplace_back(i, j);
            }
        }
    }

    EXPECT_GT(expected.size(), 100u);
    EXPECT_EQ(self_intersections(soup.vertices, soup.triangles), expected);
}

TEST(FindCrossings, EndsSoonWhereThereAreTooMany) {
    const auto two = join(icosphere(3), transformed(icosphere(3), kSame, Vec3(0.1, 0.2, 0.3)));

    const auto all = find_crossings(two.vertices, two.triangles, {}, [] {});
    const auto few = find_crossings(two.vertices, two.triangles, {.pairs = 10}, [] {});
    const auto short_look = find_crossings(two.vertices, two.triangles, {.candidates = 100}, [] {});

    EXPECT_TRUE(all.is_complete);
    EXPECT_FALSE(few.is_complete);
    EXPECT_FALSE(short_look.is_complete);
    EXPECT_LT(few.pairs.size(), all.pairs.size());
}

TEST(FindCrossings, StopsWhenTheCheckpointThrows) {
    const auto ball = icosphere(4);

    EXPECT_THROW(find_crossings(ball.vertices, ball.triangles, {}, [] { throw 1; }), int);
}

TEST(SelfIntersections, AreTheSameOnAnyNumberOfThreads) {
    const auto two = join(icosphere(3), transformed(icosphere(3), kSame, Vec3(0.3, 0.2, 0.1)));
    const auto expected = check(two);
    ASSERT_TRUE(expected.any());

    for (const int threads : {1, 2, 8}) {
        tbb::task_arena arena(threads);
        const auto actual = arena.execute([&] { return check(two); });
        EXPECT_EQ(actual.intersections, expected.intersections) << threads << " threads";
        EXPECT_EQ(actual.fault_vertices, expected.fault_vertices) << threads << " threads";
    }
}

TEST(OrientationSign, IsExact) {
    const Vec3 a(0.1, 0.2, 0.3);
    const Vec3 u(0.7, 0.1, 0.4);
    const double tiny = std::numeric_limits<double>::denorm_min();

    EXPECT_EQ(orientation_sign(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()), 1);
    EXPECT_EQ(orientation_sign(Vec3::Zero(), Vec3::UnitY(), Vec3::UnitX(), Vec3::UnitZ()), -1);
    EXPECT_EQ(orientation_sign(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), Vec3(0.3, 0.3, tiny)),
              1);
    EXPECT_EQ(orientation_sign(a, u, Vec3(0.5, 0.5, 0.5), a), 0);
}

TetMesh two_tets() {
    return {.vertices = {Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ(),
                         Vec3::Constant(1.0)},
            .tets = {{0, 1, 2, 3}, {1, 2, 3, 4}}};
}

TEST(CheckTets, PassesGoodTets) {
    EXPECT_EQ(check(two_tets()).summary(), "no faults");
}

TEST(CheckTets, FindsInvertedTets) {
    TetMesh mesh = two_tets();
    mesh.tets.pop_back();
    std::swap(mesh.tets[0][2], mesh.tets[0][3]);

    const auto faults = check(mesh);

    EXPECT_THAT(counts(faults), ElementsAre(0, 0, 0, 0, 1, 0, 0, 0));
    EXPECT_THAT(faults.fault_vertices, ElementsAre(0, 1, 2, 3));
    EXPECT_EQ(faults.summary(), "1 inverted or flat tet");
}

TEST(CheckTets, FindsFlatTets) {
    TetMesh flat = two_tets();
    flat.vertices[4] = Vec3::Constant(1.0 / 3.0);

    EXPECT_EQ(check(flat).inverted_tets, 1);
}

TEST(CheckTets, FindsTetsOnOneSideOfAFace) {
    TetMesh mesh = two_tets();
    mesh.vertices[4] = Vec3::Constant(-1.0);
    mesh.tets[1] = {1, 3, 2, 4};

    EXPECT_EQ(check(mesh).overlapping_tets, 1);
}

TEST(CheckTets, FindsFacesOfThreeTets) {
    TetMesh mesh = two_tets();
    mesh.vertices.emplace_back(2.0, 2.0, 1.0);
    mesh.tets.push_back({1, 2, 3, 5});

    EXPECT_EQ(check(mesh).overlapping_tets, 1);
}

TEST(CheckTets, ChecksTheBoundaryToo) {
    TetMesh mesh = two_tets();
    mesh.vertices.insert(mesh.vertices.end(), {-Vec3::UnitX(), -Vec3::UnitY(), -Vec3::UnitZ()});
    mesh.tets.push_back({0, 6, 5, 7});

    EXPECT_THAT(counts(check(mesh)), ElementsAre(0, 0, 1, 0, 0, 0, 0, 0));
}

TEST(CheckTets, NamesTrianglesAsInTheBoundary) {
    TetMesh mesh = two_tets();
    const Vec3 shift(0.25, 0.125, -0.5);
    for (int i = 0; i < 4; ++i) {
        mesh.vertices.emplace_back(mesh.vertices[static_cast<std::size_t>(i)] + shift);
    }
    mesh.tets.push_back({5, 6, 7, 8});

    EXPECT_EQ(check(mesh).intersections, self_intersections(mesh.vertices, boundary_of(mesh.tets)));
    EXPECT_FALSE(check(mesh).intersections.empty());
}

TEST(CheckTets, StopsWhenAsked) {
    std::stop_source source;
    source.request_stop();

    EXPECT_THROW((void)check_tets(two_tets(), RunContext(source.get_token())), Error);
    EXPECT_THROW((void)check_surface(unit_cube(), RunContext(source.get_token())), Error);
}

}  // namespace
}  // namespace remesh::testing
