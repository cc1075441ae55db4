#include "core/io/mesh_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/mesh_io_helpers.h"

namespace remesh::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class WriteThenRead : public ::testing::TestWithParam<MeshFormat> {};

TEST_P(WriteThenRead, GivesTheSameSurfaceToTheLastBit) {
    const SurfaceMesh mesh = awkward_sphere();

    const ReadResult read = read_surface(written(mesh, GetParam()), format_name(GetParam()));

    EXPECT_EQ(read.format, GetParam());
    EXPECT_EQ(read.mesh.vertices, mesh.vertices);
    EXPECT_EQ(read.mesh.triangles, mesh.triangles);
    EXPECT_THAT(read.mesh.patch, IsEmpty());
    EXPECT_THAT(read.warnings, IsEmpty());
}

TEST_P(WriteThenRead, TellsTheFormatFromTheContent) {
    const ReadResult read = read_surface(written(awkward_sphere(), GetParam()), "");

    EXPECT_EQ(read.format, GetParam());
}

TEST_P(WriteThenRead, WorksGzipped) {
    const SurfaceMesh mesh = icosphere(2);

    const ReadResult read = read_surface(gzipped(written(mesh, GetParam())), "a.gz");

    EXPECT_EQ(read.mesh.vertices, mesh.vertices);
    EXPECT_EQ(read.mesh.triangles, mesh.triangles);
}

INSTANTIATE_TEST_SUITE_P(Formats, WriteThenRead,
                         ::testing::Values(MeshFormat::Ply, MeshFormat::Off, MeshFormat::Obj,
                                           MeshFormat::Vtp, MeshFormat::Vtk),
                         [](const auto& format) { return std::string(format_name(format.param)); });

class WriteThenReadPatches : public ::testing::TestWithParam<MeshFormat> {};

TEST_P(WriteThenReadPatches, KeepsNumbersAndNames) {
    const SurfaceMesh cube = cube_with_patches();

    const SurfaceMesh read = read_surface(written(cube, GetParam()), "").mesh;

    EXPECT_EQ(read.patch, cube.patch);
    EXPECT_EQ(read.patch_names, cube.patch_names);
}

INSTANTIATE_TEST_SUITE_P(Formats, WriteThenReadPatches,
                         ::testing::Values(MeshFormat::Ply, MeshFormat::Obj, MeshFormat::Vtp),
                         [](const auto& format) { return std::string(format_name(format.param)); });

TEST(ReadSurface, SplitsPolygonsIntoFans) {
    const std::string off = "OFF\n5 1 0\n0 0 0\n1 0 0\n2 1 0\n1 2 0\n0 1 0\n5 0 1 2 3 4\n";

    EXPECT_THAT(read_surface(off, "").mesh.triangles,
                ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 3, 4}));
}

TEST(ReadSurface, LeavesOutFacesWithFewerThanThreeCorners) {
    const std::string off = "OFF\n3 2 0\n0 0 0\n1 0 0\n2 1 0\n2 0 1\n3 0 1 2\n";

    const ReadResult read = read_surface(off, "");

    EXPECT_EQ(read.mesh.triangles.size(), 1u);
    EXPECT_THAT(read.warnings,
                ElementsAre(HasSubstr("left out: 1 face with fewer than 3 corners")));
}

TEST(ReadSurface, KeepsCoordinatesThatAreNotFiniteAndWarns) {
    const std::string off =
        "OFF\n4 2 0\n0 0 0\n1 0 0\n2 1 0\n-1.#IND inf 1e999\n3 0 1 2\n3 0 1 3\n";

    const ReadResult read = read_surface(off, "");

    EXPECT_TRUE(std::isnan(read.mesh.vertices[3].x()));
    EXPECT_TRUE(std::isinf(read.mesh.vertices[3].y()));
    EXPECT_TRUE(std::isinf(read.mesh.vertices[3].z()));
    EXPECT_THAT(read.warnings, ElementsAre("OFF: coordinates that aren't finite in 1 triangle"));
}

TEST(Sizes, ComeBackFromEveryFormatThatHoldsThem) {
    const SurfaceMesh cube = unit_cube();
    std::vector<double> sizes;
    for (std::size_t i = 0; i < cube.vertices.size(); ++i) {
        sizes.push_back(0.1 + 0.01 * static_cast<double>(i));
    }
    for (const MeshFormat format : {MeshFormat::Ply, MeshFormat::Vtp, MeshFormat::Vtk}) {
        std::ostringstream out;
        write_surface(cube, format, out, sizes);
        EXPECT_EQ(read_surface(out.str(), format_name(format), {}, "h").sizes, sizes);
        EXPECT_TRUE(read_surface(out.str(), format_name(format)).sizes.empty());
    }
}

TEST(Sizes, AreNoWishWhereTheyArentPositive) {
    const std::string ply =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nproperty float size\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
        "0 0 0 0.5\n1 0 0 0\n0 1 0 -2\n3 0 1 2\n";
    const auto sizes = read_surface(ply, "ply", {}, "size").sizes;

    ASSERT_EQ(sizes.size(), 3U);
    EXPECT_EQ(sizes[0], 0.5);
    EXPECT_TRUE(std::isnan(sizes[1]));
    EXPECT_TRUE(std::isnan(sizes[2]));
}

TEST(Sizes, AreRefusedWhereThereAreNone) {
    const auto message_of = [](MeshFormat format) {
        try {
            (void)read_surface(written(unit_cube(), format), format_name(format), {}, "size");
        } catch (const Error& error) {
            return std::string(error.what());
        }
        return std::string();
    };

    for (const MeshFormat format : {MeshFormat::Ply, MeshFormat::Vtp, MeshFormat::Vtk}) {
        EXPECT_NE(message_of(format).find("no values of a scalar 'size'"), std::string::npos)
            << message_of(format);
    }
    EXPECT_NE(message_of(MeshFormat::Stl).find("read from PLY, VTP and VTK"), std::string::npos);
}

TEST(Formats, AreKnownByNameAndExtension) {
    EXPECT_EQ(format_of_name("a/b.c/aorta.STL.gz"), MeshFormat::Stl);
    EXPECT_EQ(format_of_name(".gii"), MeshFormat::Gifti);
    EXPECT_EQ(format_of_name("mesh"), MeshFormat::Medit);
    EXPECT_EQ(format_of_name("a.msh"), MeshFormat::Msh41);
    EXPECT_EQ(format_of_name("a.nii.gz"), std::nullopt);
    EXPECT_EQ(format_of_name(""), std::nullopt);
    EXPECT_EQ(format_from_string("Msh22"), MeshFormat::Msh22);
    EXPECT_EQ(format_from_string("x"), std::nullopt);
    EXPECT_EQ(format_name(MeshFormat::Vtu), "vtu");
    EXPECT_EQ(format_extension(MeshFormat::Medit), ".mesh");
}

TEST(Formats, SayWhatCanBeReadAndWritten) {
    EXPECT_TRUE(can_read(MeshFormat::Gifti));
    EXPECT_FALSE(can_write_surface(MeshFormat::Gifti));
    EXPECT_TRUE(can_write_surface(MeshFormat::Vtk));
    EXPECT_TRUE(can_write_tets(MeshFormat::Vtk));
    EXPECT_FALSE(can_read(MeshFormat::Msh41));
    EXPECT_FALSE(can_write_tets(MeshFormat::Ply));
}

}  // namespace
}  // namespace remesh::testing
