#include "core/stages/patches.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <variant>
#include <vector>

#include "core/pipeline.h"
#include "tests/support/shapes.h"

namespace remesh::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

// One patch for each plane that a side of the cube lies in: 0 and 1 across x, and so on.
SurfaceMesh cube_with_sides() {
    SurfaceMesh cube = unit_cube();
    for (const Triangle& t : cube.triangles) {
        const auto corner = [&](std::size_t k) {
            return cube.vertices[static_cast<std::size_t>(t[k])];
        };
        for (Eigen::Index axis = 0; axis < 3; ++axis) {
            const double x = corner(0)[axis];
            if (x == corner(1)[axis] && x == corner(2)[axis]) {
                cube.patch.push_back(static_cast<std::int32_t>(2 * axis + std::lround(x)));
            }
        }
    }
    cube.patch_names = {"left", "right", "front", "back", "bottom", "top"};
    return cube;
}

SurfaceMesh sphere_of_two(double border) {
    SurfaceMesh sphere = icosphere(4);
    for (const Triangle& t : sphere.triangles) {
        double z = 0.0;
        for (const Index v : t) {
            z += sphere.vertices[static_cast<std::size_t>(v)].z() / 3.0;
        }
        sphere.patch.push_back(z < border ? 0 : 1);
    }
    sphere.patch_names = {"south", "north"};
    return sphere;
}

RemeshResult remeshed(const SurfaceMesh& input, double h, PatchSource source,
                      std::vector<Warning>* warnings = nullptr) {
    RunContext run({}, [&](const RunEvent& event) {
        if (const auto* warning = std::get_if<Warning>(&event); warning && warnings) {
            warnings->push_back(*warning);
        }
    });
    RemeshOptions options;
    options.edge_length = h;
    options.patches = source;
    return run_pipeline(input, options, run);
}

double area_of(const SurfaceMesh& surface, std::int32_t patch) {
    double area = 0.0;
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        const auto corner = [&](std::size_t k) {
            return surface.vertices[static_cast<std::size_t>(surface.triangles[t][k])];
        };
        if (surface.patch[t] == patch) {
            area += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
        }
    }
    return area;
}

std::vector<double> areas_of(const SurfaceMesh& surface) {
    std::vector<double> areas(
        static_cast<std::size_t>(*std::max_element(surface.patch.begin(), surface.patch.end())) +
        1);
    for (std::size_t i = 0; i < areas.size(); ++i) {
        areas[i] = area_of(surface, static_cast<std::int32_t>(i));
    }
    return areas;
}

// Largest distance of a vertex of the patch from the plane x[axis] = at.
double off_plane(const SurfaceMesh& surface, std::int32_t patch, Eigen::Index axis, double at) {
    double most = 0.0;
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        for (const Index v : surface.triangles[t]) {
            const double x = surface.vertices[static_cast<std::size_t>(v)][axis];
            most = surface.patch[t] == patch ? std::max(most, std::abs(x - at)) : most;
        }
    }
    return most;
}

TEST(CarryPatches, KeepsEverySideOfACube) {
    const SurfaceMesh cube = cube_with_sides();

    const SurfaceMesh result = remeshed(cube, 0.2, PatchSource::Input).surface;

    EXPECT_EQ(result.patch_names, cube.patch_names);
    ASSERT_EQ(result.patch.size(), result.triangles.size());
    for (std::int32_t side = 0; side < 6; ++side) {
        EXPECT_NEAR(area_of(result, side), 1.0, 1e-9) << side;
        EXPECT_LT(off_plane(result, side, side / 2, side % 2), 1e-9) << side;
    }
}

TEST(CarryPatches, SurvivesSoupTurnedTrianglesAndAShuffle) {
    const SurfaceMesh cube = cube_with_sides();
    SurfaceMesh damaged = as_soup(with_triangles_flipped(cube, 0.3, 3));
    damaged.patch = cube.patch;
    std::reverse(damaged.triangles.begin(), damaged.triangles.end());
    std::reverse(damaged.patch.begin(), damaged.patch.end());

    const SurfaceMesh result = remeshed(damaged, 0.2, PatchSource::Input).surface;

    ASSERT_EQ(result.patch.size(), result.triangles.size());
    for (std::int32_t side = 0; side < 6; ++side) {
        EXPECT_LT(off_plane(result, side, side / 2, side % 2), 1e-9) << side;
    }
}

TEST(CarryPatches, KeepsASmoothBorderWhereItWas) {
    const SurfaceMesh result = remeshed(sphere_of_two(0.3), 0.12, PatchSource::Input).surface;

    const double all = area_of(result, 0) + area_of(result, 1);
    EXPECT_NEAR(area_of(result, 1) / all, 0.35, 0.01);  // A cap's area is 2 pi (1 - z).
    // No triangle reaches farther than an edge across it.
    for (std::size_t t = 0; t < result.triangles.size(); ++t) {
        for (const Index v : result.triangles[t]) {
            const double z = result.vertices[static_cast<std::size_t>(v)].z();
            EXPECT_LT(result.patch[t] == 1 ? 0.3 - z : z - 0.3, 0.12) << t;
        }
    }
}

TEST(CarryPatches, MakesAPatchOfClosedHoles) {
    SurfaceMesh open = cube_with_sides();
    for (std::size_t t = open.triangles.size(); t-- > 0;) {
        if (open.patch[t] == 5) {
            open.triangles.erase(open.triangles.begin() + static_cast<std::ptrdiff_t>(t));
            open.patch.erase(open.patch.begin() + static_cast<std::ptrdiff_t>(t));
        }
    }

    const SurfaceMesh result = remeshed(open, 0.1, PatchSource::Input).surface;

    ASSERT_EQ(result.patch_names.size(), 7U);
    EXPECT_EQ(result.patch_names[6], "closed holes");
    EXPECT_EQ(result.patch_names[5], "top");
    EXPECT_EQ(std::count(result.patch.begin(), result.patch.end(), 5), 0);
    EXPECT_NEAR(area_of(result, 6), 1.0, 0.2);
}

TEST(CarryPatches, GivesPinholesThePatchAroundThem) {
    SurfaceMesh leaky = sphere_of_two(0.0);
    for (std::size_t t = leaky.triangles.size(); t-- > 0;) {
        const Triangle& corners = leaky.triangles[t];
        if (std::find(corners.begin(), corners.end(), 0) != corners.end()) {
            leaky.triangles.erase(leaky.triangles.begin() + static_cast<std::ptrdiff_t>(t));
            leaky.patch.erase(leaky.patch.begin() + static_cast<std::ptrdiff_t>(t));
        }
    }
    ASSERT_EQ(leaky.triangles.size(), icosphere(4).triangles.size() - 5);

    const SurfaceMesh result = remeshed(leaky, 0.07, PatchSource::Input).surface;

    ASSERT_EQ(result.patch.size(), result.triangles.size());
    EXPECT_EQ(result.patch_names, leaky.patch_names);  // None of closed holes.
    EXPECT_EQ(std::count_if(result.patch.begin(), result.patch.end(),
                            [](std::int32_t patch) { return patch < 0 || patch > 1; }),
              0);
}

TEST(CarryPatches, TellsOfAPatchThatIsTooSmall) {
    SurfaceMesh sphere = icosphere(4);
    sphere.patch.assign(sphere.triangles.size(), 0);
    sphere.patch[77] = 1;
    sphere.patch_names = {"wall", "speck"};
    std::vector<Warning> warnings;

    const SurfaceMesh result = remeshed(sphere, 0.3, PatchSource::Input, &warnings).surface;

    EXPECT_EQ(std::count(result.patch.begin(), result.patch.end(), 1), 0);
    const auto lost = std::find_if(warnings.begin(), warnings.end(),
                                   [](const Warning& w) { return w.code == "PATCH_LOST"; });
    ASSERT_NE(lost, warnings.end());
    EXPECT_THAT(lost->message, HasSubstr("\"speck\""));
}

TEST(CarryPatches, GivesNoneToAnInputWithoutThem) {
    EXPECT_THAT(remeshed(unit_cube(), 0.3, PatchSource::Input).surface.patch, IsEmpty());
    EXPECT_THAT(remeshed(cube_with_sides(), 0.3, PatchSource::None).surface.patch, IsEmpty());
}

TEST(NumberFaces, FindsTheSidesOfAnL) {
    const SurfaceMesh result = remeshed(l_shape(), 0.2, PatchSource::Faces).surface;

    const std::vector<double> areas = areas_of(result);
    ASSERT_EQ(areas.size(), 8U);
    for (const auto& [first, last, area] : {std::tuple{0, 2, 3.0}, {2, 4, 2.0}, {4, 8, 1.0}}) {
        for (int i = first; i < last; ++i) {
            EXPECT_NEAR(areas[static_cast<std::size_t>(i)], area, 1e-9) << i;
        }
    }
}

TEST(NumberFaces, CountsASmoothBodyAsOne) {
    const SurfaceMesh two =
        join(icosphere(3),
             transformed(icosphere(3), 0.5 * Eigen::Matrix3d::Identity(), Vec3(3.0, 0.0, 0.0)));

    const SurfaceMesh result = remeshed(two, 0.2, PatchSource::Faces).surface;

    const std::vector<double> areas = areas_of(result);
    ASSERT_EQ(areas.size(), 2U);
    EXPECT_NEAR(areas[0] / areas[1], 4.0, 0.2);
}

}  // namespace
}  // namespace remesh::testing
