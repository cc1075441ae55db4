#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/io/mesh_io.h"
#include "tests/unit/mesh_io_helpers.h"

namespace remesh::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(WriteStl, RoundsToSinglePrecisionAndUnsharesVertices) {
    const SurfaceMesh mesh = icosphere(1);

    const SurfaceMesh read = read_surface(written(mesh, MeshFormat::Stl), "a.stl").mesh;

    ASSERT_EQ(read.triangles.size(), mesh.triangles.size());
    ASSERT_EQ(read.vertices.size(), 3 * mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (std::size_t i = 0; i < 3; ++i) {
            const Vec3& v = mesh.vertices[static_cast<std::size_t>(mesh.triangles[t][i])];
            EXPECT_EQ(read.vertices[3 * t + i], v.cast<float>().cast<double>());
        }
    }
}

TEST(WriteStl, WritesNoNegativeZeros) {
    SurfaceMesh mesh = unit_cube();
    mesh.vertices[0] = Vec3::Constant(-0.0);

    const SurfaceMesh read = read_surface(written(mesh, MeshFormat::Stl), "a.stl").mesh;

    for (const auto& v : read.vertices) {
        EXPECT_FALSE(std::signbit(v.x()) || std::signbit(v.y()) || std::signbit(v.z()));
    }
}

TEST(WriteStl, RefusesCoordinatesBeyondSinglePrecision) {
    SurfaceMesh mesh = unit_cube();
    mesh.vertices[0].x() = 1e300;

    EXPECT_THROW((void)written(mesh, MeshFormat::Stl), Error);
}

TEST(WriteVtk, KeepsTheNumbersOfPatchesAsTheirNames) {
    const SurfaceMesh read =
        read_surface(written(cube_with_patches(), MeshFormat::Vtk), "a.vtk").mesh;

    EXPECT_EQ(read.patch, cube_with_patches().patch);
    EXPECT_THAT(read.patch_names, ElementsAre("0", "1", "2", "3", "4", "5"));
}

TEST(WriteSurface, RefusesFormatsForTets) {
    EXPECT_THROW((void)written(unit_cube(), MeshFormat::Vtu), Error);
    EXPECT_THROW((void)written(unit_cube(), MeshFormat::Gifti), Error);
}

TEST(WriteTets, RefusesFormatsForSurfaces) {
    EXPECT_THROW((void)written(two_regions(), MeshFormat::Stl), Error);
}

TEST(WriteTets, GivesSolversBoundaryTrianglesWithLabelsInMedit) {
    const std::string text = written(two_regions(), MeshFormat::Medit);

    EXPECT_THAT(text, HasSubstr("Vertices\n8\n0 0 0 0\n1 0 0 0\n"));
    EXPECT_THAT(text, HasSubstr("Triangles\n12\n"));
    EXPECT_THAT(text, HasSubstr("Tetrahedra\n6\n1 2 4 8 1\n"));
    EXPECT_THAT(text, HasSubstr("1 6 2 8 2\nEnd\n"));
}

TEST(WriteTets, NamesRegionsAndBoundariesInGmsh) {
    const std::string names =
        "$PhysicalNames\n4\n2 1 \"boundary_1\"\n2 2 \"boundary_2\"\n"
        "3 1 \"region_1\"\n3 2 \"region_2\"\n$EndPhysicalNames\n";

    const std::string old = written(two_regions(), MeshFormat::Msh22);
    EXPECT_THAT(old, HasSubstr("2.2 0 8\n"));
    EXPECT_THAT(old, HasSubstr(names));
    EXPECT_THAT(old, HasSubstr("$Elements\n18\n"));
    EXPECT_THAT(old, HasSubstr("\n18 4 2 2 2 1 6 2 8\n$EndElements"));

    const std::string recent = written(two_regions(), MeshFormat::Msh41);
    EXPECT_THAT(recent, HasSubstr("4.1 0 8\n"));
    EXPECT_THAT(recent, HasSubstr(names));
    EXPECT_THAT(recent, HasSubstr("$Elements\n4 18 1 18\n2 1 2 6\n"));
    EXPECT_THAT(recent, HasSubstr("3 2 4 3\n16 1 7 5 8\n"));
}

TEST(WriteTets, PutsTetsOfNoRegionInRegionOne) {
    TetMesh mesh = two_regions();
    mesh.region.clear();

    EXPECT_THAT(written(mesh, MeshFormat::Medit), HasSubstr("1 6 2 8 1\nEnd\n"));
}

TEST(WriteTets, RefusesRegionsBelowOneWhereSolversDo) {
    TetMesh mesh = two_regions();
    mesh.region[0] = 0;

    EXPECT_THROW((void)written(mesh, MeshFormat::Medit), Error);
}

TEST(WriteTets, WritesBinaryBigEndianLegacyVtk) {
    const std::string bytes = written(two_regions(), MeshFormat::Vtk);

    EXPECT_THAT(bytes, HasSubstr("DATASET UNSTRUCTURED_GRID\nPOINTS 8 double\n" +
                                 bytes_of(0.0, std::endian::big)));
    EXPECT_THAT(bytes, HasSubstr("\nCELLS 6 30\n" + bytes_of(4, std::endian::big) +
                                 bytes_of(0, std::endian::big) + bytes_of(1, std::endian::big)));
    EXPECT_THAT(bytes, HasSubstr("\nCELL_TYPES 6\n" + bytes_of(10, std::endian::big)));
}

TEST(WriteTets, CompressesTheBlocksOfVtu) {
    const std::string text = written(two_regions(), MeshFormat::Vtu);

    EXPECT_THAT(text, HasSubstr("<Piece NumberOfPoints=\"8\" NumberOfCells=\"6\">"));
    std::string types(6, '\x0a');
    const std::string compressed = deflated(types, 15);
    EXPECT_THAT(text, HasSubstr("type=\"UInt8\" Name=\"types\""));
    // One block; it's the last and partial one, of 6 bytes.
    EXPECT_THAT(text,
                HasSubstr(base64(bytes_of(std::uint64_t{1}) + bytes_of(std::uint64_t{1} << 17) +
                                 bytes_of(std::uint64_t{6}))));
}

TEST(WriteTets, GivesBoundaryTrianglesTheirPatches) {
    TetMesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    mesh.tets = {{0, 1, 2, 3}};
    SurfaceMesh boundary = boundary_surface(mesh);
    boundary.patch = {2, 0, 0, 2};
    boundary.patch_names = {"the \"wall\"", "unused", "inlet"};
    const auto text_of = [&](MeshFormat format) {
        std::ostringstream out;
        write_tets(mesh, format, out, {}, boundary);
        return out.str();
    };

    EXPECT_THAT(text_of(MeshFormat::Medit),
                AllOf(HasSubstr("3 4 3\n"), HasSubstr(" 1\n"), HasSubstr("1 2 3 4 1\nEnd")));
    const std::string names = "3\n2 1 \"the__wall_\"\n2 3 \"inlet\"\n3 1 \"region_1\"\n";
    EXPECT_THAT(text_of(MeshFormat::Msh22),
                AllOf(HasSubstr("$PhysicalNames\n" + names), HasSubstr("1 2 2 3 3 "),
                      HasSubstr("2 2 2 1 1 "), HasSubstr("5 4 2 1 1 ")));
    EXPECT_THAT(text_of(MeshFormat::Msh41),
                AllOf(HasSubstr("$PhysicalNames\n" + names), HasSubstr("$Entities\n0 0 2 1\n"),
                      HasSubstr("0 0 0 1 1 1 1 1 2 1 3\n"), HasSubstr("$Elements\n3 5 1 5\n"),
                      HasSubstr("2 1 2 2\n"), HasSubstr("2 3 2 2\n"), HasSubstr("3 1 4 1\n")));

    boundary.patch.pop_back();
    EXPECT_THROW(text_of(MeshFormat::Medit), Error);
}

}  // namespace
}  // namespace remesh::testing
