#include "core/stages/prepare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/error.h"
#include "tests/support/prepared.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

using testing::count_of;
using ::testing::HasSubstr;
using testing::icosphere;
using testing::kTorusVolume;
using testing::prepare;
using testing::sampled_volume;
using testing::some_torus;
using testing::torus;
using testing::unit_cube;

template <typename Call>
void expect_error(ErrorCode code, const std::string& text, Call call) {
    try {
        call();
        FAIL() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), code);
        EXPECT_THAT(error.what(), HasSubstr(text));
    }
}

TEST(PrepareSurface, KeepsACleanSurfaceAsItIs) {
    const auto mesh = some_torus();

    const auto result = prepare(mesh, 0.1);

    EXPECT_EQ(result.domain->boundary().triangles.size(), mesh.triangles.size());
    EXPECT_TRUE(result.defects.empty());
    EXPECT_FALSE(result.smoothed);
    EXPECT_NEAR(result.facts.volume, kTorusVolume, 0.02 * kTorusVolume);
}

TEST(PrepareSurface, TurnsAnInvertedSurfaceAround) {
    auto mesh = some_torus();
    for (auto& t : mesh.triangles) {
        std::swap(t[0], t[1]);
    }

    const auto result = prepare(mesh, 0.1);

    EXPECT_EQ(count_of(result, "INSIDE_OUT"), 1);
    EXPECT_EQ(result.domain->region_at({1.0, 0.0, 0.0}), 1);
    EXPECT_EQ(result.domain->region_at({0.0, 0.0, 0.0}), 0);
}

TEST(PrepareSurface, TurnsFlippedTrianglesAround) {
    const auto result = prepare(testing::with_triangles_flipped(some_torus(), 0.2, 5), 0.1);

    EXPECT_GT(count_of(result, "FLIPPED_TRIANGLES"), 0);
    EXPECT_NEAR(result.facts.volume, kTorusVolume, 0.02 * kTorusVolume);
}

TEST(PrepareSurface, WeldsSoupWithSharedPositions) {
    const auto result = prepare(testing::as_soup(some_torus()), 0.1);

    EXPECT_EQ(result.facts.vertices, 1800);
    EXPECT_EQ(result.facts.boundary_edges, 0);
}

TEST(PrepareSurface, LeavesLargeLooseTrianglesOfAThinBodyAsTheyAre) {
    // Twelve triangles of a plate, none joined to another, each far larger than the plate is thick.
    auto plate = testing::transformed(unit_cube(), Vec3(1.0, 1.0, 0.1).asDiagonal(), Vec3::Zero());
    plate = testing::with_noise(testing::as_soup(plate), 1e-4, 1);

    const auto result = prepare(plate, 0.1);

    EXPECT_EQ(count_of(result, "FLIPPED_TRIANGLES"), 0);
    EXPECT_NEAR(result.facts.volume, 0.1, 0.005);
}

TEST(PrepareSurface, TurnsASoupThatFacesInwardAllOver) {
    auto mesh = testing::with_noise(testing::as_soup(some_torus()), 0.005, 1);
    for (auto& t : mesh.triangles) {
        std::swap(t[0], t[1]);
    }

    const auto result = prepare(mesh, 0.1);

    EXPECT_NEAR(sampled_volume(*result.domain), kTorusVolume, 0.03 * kTorusVolume);
    EXPECT_EQ(result.domain->region_at({1.0, 0.0, 0.0}), 1);
}

TEST(PrepareSurface, TurnsOpenPartsSoThatTheyEncloseABodyTogether) {
    SurfaceMesh outer = some_torus();
    SurfaceMesh inner = some_torus();
    const auto is_outer = [&](const Triangle& t) {
        Vec3 middle = Vec3::Zero();
        for (const Index v : t) {
            middle += outer.vertices[static_cast<std::size_t>(v)] / 3.0;
        }
        return middle.head<2>().norm() > 1.0;
    };
    std::erase_if(outer.triangles, [&](const Triangle& t) { return !is_outer(t); });
    std::erase_if(inner.triangles, is_outer);
    // A hair's breadth apart, so that they aren't welded.
    const auto mesh = testing::join(
        outer, testing::transformed(inner, 0.999 * Eigen::Matrix3d::Identity(), Vec3::Zero()));

    const auto result = prepare(mesh, 0.1);

    EXPECT_NEAR(sampled_volume(*result.domain), kTorusVolume, 0.02 * kTorusVolume);
}

TEST(PrepareSurface, IgnoresTrianglesThatAreNotFinite) {
    auto mesh = some_torus();
    const auto v = static_cast<Index>(mesh.vertices.size());
    mesh.vertices.emplace_back(std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0);
    mesh.vertices.emplace_back(1e38, 0.0, 0.0);
    mesh.triangles.push_back({v, 0, 1});
    mesh.triangles.push_back({v + 1, 2, 3});

    const auto result = prepare(mesh, 0.1);

    EXPECT_EQ(count_of(result, "NON_FINITE"), 2);
    EXPECT_LT(result.facts.bounds.diagonal(), 5.0);
}

TEST(PrepareSurface, DropsDuplicateAndDegenerateTriangles) {
    auto mesh = some_torus();
    const Triangle first = mesh.triangles.front();
    mesh.triangles.push_back({first[1], first[2], first[0]});
    mesh.triangles.push_back({first[1], first[0], first[2]});
    mesh.triangles.push_back({first[0], first[0], first[2]});

    const auto result = prepare(mesh, 0.1);

    EXPECT_EQ(count_of(result, "DUPLICATE_TRIANGLES"), 2);
    EXPECT_EQ(count_of(result, "DEGENERATE_TRIANGLES"), 1);
    EXPECT_EQ(result.facts.duplicate_triangles, 2);
    EXPECT_EQ(result.facts.degenerate_triangles, 1);
}

TEST(PrepareSurface, TellsOfTrianglesThatCross) {
    const auto mesh = testing::join(
        some_torus(), testing::transformed(some_torus(), Eigen::Matrix3d::Identity(), {0, 0, 0.5}));

    const auto result = prepare(mesh, 0.1);

    EXPECT_GT(count_of(result, "SELF_INTERSECTIONS"), 100);
}

TEST(PrepareSurface, TellsOfASizeThatIsHardlyInMillimetres) {
    const auto scaled = [](double scale) {
        return testing::transformed(some_torus(), scale * Eigen::Matrix3d::Identity(),
                                    Vec3::Zero());
    };

    EXPECT_EQ(count_of(prepare(some_torus(), 0.1), "UNITS"), 0);
    EXPECT_EQ(count_of(prepare(scaled(0.1), 0.01), "UNITS"), 1);
    EXPECT_EQ(count_of(prepare(scaled(1e4), 1e3), "UNITS"), 1);
}

TEST(PrepareSurface, DropsASecondWall) {
    const auto inner =
        testing::transformed(some_torus(), 0.98 * Eigen::Matrix3d::Identity(), Vec3::Zero());

    const auto result = prepare(testing::join(some_torus(), inner), 0.1);

    EXPECT_EQ(count_of(result, "DOUBLE_WALL"), 1);
}

TEST(PrepareSurface, DropsSpecks) {
    const auto speck =
        testing::transformed(icosphere(1), 0.05 * Eigen::Matrix3d::Identity(), {3, 0, 0});

    const auto result = prepare(testing::join(some_torus(), speck), 0.1);

    EXPECT_EQ(count_of(result, "SPECKS"), 1);
    EXPECT_EQ(result.domain->region_at({3.0, 0.0, 0.0}), 0);
}

SurfaceMesh hollow_ball() {
    auto inner =
        testing::transformed(icosphere(3), 0.5 * Eigen::Matrix3d::Identity(), Vec3::Zero());
    for (auto& t : inner.triangles) {
        std::swap(t[0], t[1]);
    }
    return testing::join(icosphere(3), inner);
}

TEST(PrepareSurface, FillsCavities) {
    const auto result = prepare(hollow_ball(), 0.1);

    EXPECT_EQ(count_of(result, "CAVITIES"), 1);
    EXPECT_EQ(result.domain->region_at(Vec3::Zero()), 1);
}

TEST(PrepareSurface, KeepsCavitiesWhenAsked) {
    const auto result = prepare(hollow_ball(), 0.1, {.keep_cavities = true});

    EXPECT_EQ(result.domain->region_at(Vec3::Zero()), 0);
    EXPECT_EQ(result.domain->region_at({0.75, 0.0, 0.0}), 1);
}

TEST(PrepareSurface, KeepsCavitiesOfAnInvertedSurface) {
    auto mesh = hollow_ball();
    for (auto& t : mesh.triangles) {
        std::swap(t[0], t[1]);
    }

    const auto result = prepare(mesh, 0.1, {.keep_cavities = true});

    EXPECT_EQ(result.domain->region_at(Vec3::Zero()), 0);
    EXPECT_EQ(result.domain->region_at({0.75, 0.0, 0.0}), 1);
}

TEST(PrepareSurface, TakesOverlappingPartsAsOneBody) {
    const auto mesh = testing::join(
        unit_cube(),
        testing::transformed(unit_cube(), Eigen::Matrix3d::Identity(), {0.5, 0.1, 0.1}));

    const auto result = prepare(mesh, 0.1);

    EXPECT_EQ(result.domain->region_at({0.75, 0.5, 0.5}), 1);
    EXPECT_GT(result.domain->closest({0.75, 0.5, 0.5}).distance, 0.35);
}

TEST(PrepareSurface, GivesTheSameBitsOnAnyNumberOfThreads) {
    const auto mesh = testing::with_noise(
        testing::with_triangles_removed(
            testing::with_triangles_flipped(torus(1.0, 0.4, 30, 15), 0.1, 1), 0.05, 2),
        0.02, 3);
    const auto on = [&](int threads) {
        tbb::task_arena arena(threads);
        return arena.execute([&] { return prepare(mesh, 0.15, {.smoothing = Smoothing::On}); });
    };

    const auto expected = on(1);
    for (const int threads : {2, 3}) {
        const auto actual = on(threads);
        EXPECT_EQ(actual.domain->boundary().vertices, expected.domain->boundary().vertices);
        EXPECT_EQ(actual.domain->boundary().triangles, expected.domain->boundary().triangles);
    }
}

TEST(PrepareSurface, RefusesASurfaceWithoutTriangles) {
    expect_error(ErrorCode::InvalidInput, "no triangles", [] { prepare({}, 0.1); });
}

TEST(PrepareSurface, RefusesTrianglesWithoutArea) {
    SurfaceMesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 0, 1}};

    expect_error(ErrorCode::InvalidInput, "area", [&] { prepare(mesh, 0.1); });
}

TEST(PrepareSurface, RefusesASingleTriangle) {
    SurfaceMesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};

    expect_error(ErrorCode::Unmeshable, "enclose no body", [&] { prepare(mesh, 0.1); });
}

TEST(PrepareSurface, RefusesAFlatSheet) {
    auto mesh = some_torus();
    for (auto& v : mesh.vertices) {
        v[2] = 0.0;
    }

    expect_error(ErrorCode::Unmeshable, "enclose no body", [&] { prepare(mesh, 0.1); });
}

TEST(PrepareSurface, RefusesASheetThatFoldsBackOnItself) {
    SurfaceMesh sheet;
    for (int i = 0; i < 400; ++i) {
        sheet.vertices.emplace_back(std::fmod(37.7 * i, 100.0), std::fmod(61.3 * i, 100.0), 5.0);
    }
    for (Index i = 0; i + 2 < 400; ++i) {
        sheet.triangles.push_back({i, i + 1, i + 2});
    }

    expect_error(ErrorCode::Unmeshable, "enclose no body", [&] { prepare(sheet, 3.0); });
}

TEST(PrepareSurface, RefusesRandomTriangles) {
    SurfaceMesh mesh;
    for (Index i = 0; i < 300; ++i) {
        const auto x = [i](int k) { return std::fmod(std::abs(std::sin(7.1 * i + k)) * 1e4, 1.0); };
        mesh.vertices.emplace_back(x(1), x(2), x(3));
    }
    for (Index i = 0; i < 100; ++i) {
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }

    expect_error(ErrorCode::Unmeshable, "enclose no body", [&] { prepare(mesh, 0.1); });
}

TEST(PrepareSurface, RefusesAnEdgeLengthFarBeyondTheBody) {
    expect_error(ErrorCode::Unmeshable, "edge_length", [] { prepare(unit_cube(), 100.0); });
}

TEST(PrepareSurface, CopesWithATinyEdgeLength) {
    const auto result = prepare(unit_cube(), 1e-9);

    EXPECT_NEAR(result.facts.volume, 1.0, 1e-9);
}

TEST(PrepareSurface, StopsWhenAsked) {
    std::stop_source source;
    source.request_stop();
    RunContext run(source.get_token());

    expect_error(ErrorCode::Cancelled, "cancelled",
                 [&] { prepare_surface(some_torus(), 0.1, {}, run); });
}

TEST(PrepareOptions, AreCheckedAtTheDoor) {
    expect_error(ErrorCode::InvalidInput, "max_displacement",
                 [] { validate(PrepareOptions{.max_displacement = 0.0}); });
    expect_error(ErrorCode::InvalidInput, "speck_volume",
                 [] { validate(PrepareOptions{.speck_volume = 1.0}); });
    expect_error(ErrorCode::InvalidInput, "edge_length", [] { prepare(unit_cube(), 0.0); });
}

TEST(SuggestEdgeLength, IsTheMeanEdgeOfASphere) {
    EXPECT_NEAR(suggest_edge_length(icosphere(3)), 0.15, 0.03);
}

TEST(SuggestEdgeLength, PutsTwoElementsAcrossACoarseBody) {
    EXPECT_NEAR(suggest_edge_length(unit_cube()), 0.25, 1e-9);
}

}  // namespace
}  // namespace remesh
