#include "core/io/mesh_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/unit/mesh_io_helpers.h"

namespace remesh::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::string_view kTetrahedron =
    "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

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

TEST(ReadStl, ReadsAsciiInAnyCaseWithAnyLineEnds) {
    const std::string stl =
        "\xef\xbb\xbfSOLID a b\r\nFACET NORMAL 0 0 nan\r\nOUTER LOOP\r\nVERTEX 0 0 0\r\n"
        "vertex +1.5 0 0\r\nVERTEX 0 1e-400 -2E1\r\nENDLOOP\r\nENDFACET\r\nENDSOLID a b\r\n";

    const SurfaceMesh mesh = read_surface(stl, "a.STL").mesh;

    EXPECT_THAT(mesh.vertices, ElementsAre(Vec3(0, 0, 0), Vec3(1.5, 0, 0), Vec3(0, 0, -20)));
    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}));
}

TEST(ReadStl, MakesPatchesOfSolidsByName) {
    const auto solid = [](const std::string& name) {
        return "solid " + name +
               "\nfacet normal 0 0 0 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop "
               "endfacet\nendsolid\n";
    };

    const SurfaceMesh mesh =
        read_surface(solid("inlet") + solid("") + solid("inlet") + solid("wall"), "a.stl").mesh;

    EXPECT_THAT(mesh.patch, ElementsAre(0, 1, 0, 2));
    EXPECT_THAT(mesh.patch_names, ElementsAre("inlet", "solid 2", "wall"));
}

TEST(ReadStl, TellsBinaryFromAsciiThoughTheHeaderSaysSolid) {
    std::string stl = written(unit_cube(), MeshFormat::Stl);
    stl.replace(0, 5, "solid");

    EXPECT_EQ(read_surface(stl, "a.stl").mesh.triangles.size(), 12u);
}

TEST(ReadPly, ReadsBothByteOrdersAndSkipsWhatItDoesNotKnow) {
    for (const auto order : {std::endian::little, std::endian::big}) {
        std::string ply =
            std::string("ply\nformat ") +
            (order == std::endian::big ? "binary_big_endian" : "binary_little_endian") +
            " 1.0\nobj_info x\nelement camera 2\nproperty list uchar short shots\nelement vertex 3"
            "\nproperty uchar red\nproperty double z\nproperty float x\nproperty short y\n"
            "element face 1\nproperty list ushort uint vertex_index\nproperty float quality\n"
            "end_header\n";
        ply += bytes_of(std::uint8_t{2}, order) + bytes_of(std::int16_t{1}, order) +
               bytes_of(std::int16_t{2}, order) + bytes_of(std::uint8_t{0}, order);
        for (const int i : {0, 1, 2}) {
            ply += bytes_of(std::uint8_t{255}, order) + bytes_of(0.1 * i, order) +
                   bytes_of(0.5F * static_cast<float>(i), order) +
                   bytes_of(static_cast<std::int16_t>(-i), order);
        }
        ply += bytes_of(std::uint16_t{3}, order) + bytes_of(2U, order) + bytes_of(1U, order) +
               bytes_of(0U, order) + bytes_of(1.0F, order);

        const SurfaceMesh mesh = read_surface(ply, "").mesh;

        EXPECT_THAT(mesh.vertices,
                    ElementsAre(Vec3(0, 0, 0), Vec3(0.5, -1, 0.1), Vec3(1, -2, 0.2)));
        EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{2, 1, 0}));
    }
}

TEST(ReadPly, ReadsAscii) {
    const std::string ply =
        "ply\r\nformat ascii 1.0\r\ncomment c\r\nelement vertex 3\r\nproperty float x\r\n"
        "property float y\r\nproperty float z\r\nelement face 1\r\n"
        "property list uchar int vertex_indices\r\nend_header\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n3 0 1 "
        "2\r\n";

    EXPECT_THAT(read_surface(ply, "").mesh.triangles, ElementsAre(Triangle{0, 1, 2}));
}

TEST(ReadOff, ReadsNormalsColoursAndCommentsPastThePositions) {
    const std::string off =
        "# made by hand\nCNOFF # with both\n3 1 0\n0 0 0 0 0 1 255 0 0 255\n\n1 0 0 0 0 1 0 255 0 "
        "255 # two\n0 1 0 0 0 1 0 0 255 255\n3 0 1 2 0.5 0.5 0.5\n";

    EXPECT_EQ(read_surface(off, "").mesh.vertices[1], Vec3(1, 0, 0));
}

TEST(ReadOff, ReadsFilesWithoutTheirKeyword) {
    const std::string off = "4 4 6\n" + std::string(kTetrahedron);

    EXPECT_EQ(read_surface(off, "x.off").mesh.triangles.size(), 4u);
}

TEST(ReadObj, ReadsGroupsNegativeIndicesAndContinuedLines) {
    const std::string obj =
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nvn 0 0 1\nv 1 1 0\nv 0 1 0\no body\n"
        "f 1/1/1 2//1 3/1\ng in let\nusemtl red\nf -4 \\\n -2 -1 # comment\ng\nl 1 2\nf 1 2 3 4\n"
        "g in let\nf 1 2 4\n";

    const SurfaceMesh mesh = read_surface(obj, "a.obj").mesh;

    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 1, 2},
                                            Triangle{0, 2, 3}, Triangle{0, 1, 3}));
    EXPECT_THAT(mesh.patch, ElementsAre(0, 1, 2, 2, 1));
    EXPECT_THAT(mesh.patch_names, ElementsAre("body", "in let", "default"));
}

TEST(ReadVtk, ReadsAsciiOfVersion4WithLinesStripsAndAttributes) {
    const std::string vtk =
        "# vtk DataFile Version 4.2\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0\n"
        "1 1 0 0 1 0\nMETADATA\nINFORMATION 0\n\nLINES 1 3\n2 0 1\nPOLYGONS 2 8\n3 0 1 2\n3 0 2 3\n"
        "TRIANGLE_STRIPS 1 5\n4 0 1 3 2\nPOINT_DATA 4\nSCALARS s float\nLOOKUP_TABLE default\n"
        "1 2 3 4\nNORMALS n float\n0 0 1 0 0 1 0 0 1 0 0 1\nCELL_DATA 4\nFIELD f 2\n"
        "weight 1 4 double\n1 2 3 4\nlabel 1 4 int\n9 5 5 9\n";

    const SurfaceMesh mesh = read_surface(vtk, "").mesh;

    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 1, 3},
                                            Triangle{3, 1, 2}));
    EXPECT_THAT(mesh.patch, ElementsAre(0, 0, 1, 1));
    EXPECT_THAT(mesh.patch_names, ElementsAre("5", "9"));
}

TEST(ReadVtk, ReadsBinaryOfVersion5) {
    const auto big = [](auto... values) { return (bytes_of(values, std::endian::big) + ...); };
    const std::string vtk =
        "# vtk DataFile Version 5.1\ntitle\nBINARY\nDATASET POLYDATA\nPOINTS 3 double\n" +
        big(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0) +
        "\nPOLYGONS 2 3\nOFFSETS vtktypeint64\n" + big(std::int64_t{0}, std::int64_t{3}) +
        "\nCONNECTIVITY vtktypeint64\n" + big(std::int64_t{0}, std::int64_t{1}, std::int64_t{2}) +
        "\n";

    EXPECT_THAT(read_surface(vtk, "").mesh.triangles, ElementsAre(Triangle{0, 1, 2}));
}

// A VTP file of one triangle whose points are encoded as told.
std::string vtp(const std::string& file_attributes, const std::string& points,
                const std::string& data, const std::string& rest = "") {
    return "<?xml version=\"1.0\"?><VTKFile type=\"PolyData\" " + file_attributes +
           "><PolyData><Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><Points><DataArray "
           "type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\" " +
           points + ">" + data +
           "</DataArray></Points><Polys><DataArray type=\"Int64\" Name=\"connectivity\" "
           "format=\"ascii\">0 1 2</DataArray><DataArray type=\"UInt8\" Name=\"offsets\" "
           "format=\"ascii\">3</DataArray></Polys></Piece></PolyData>" +
           rest + "</VTKFile>";
}

std::string floats(std::endian order) {
    std::string bytes;
    for (const float x : {0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 2.F}) {
        bytes += bytes_of(x, order);
    }
    return bytes;
}

const Points kThreePoints{{0, 0, 0}, {1, 0, 0}, {0, 1, 2}};

TEST(ReadVtp, ReadsText) {
    const std::string file = vtp("", "format=\"ascii\"", "0 0 0 1 0 0\n0 1 2\n");

    EXPECT_EQ(read_surface(file, "").mesh.vertices, kThreePoints);
}

TEST(ReadVtp, ReadsPlainBase64WithEitherHeader) {
    const std::string data = floats(std::endian::little);

    EXPECT_EQ(read_surface(vtp("byte_order=\"LittleEndian\"", "format=\"binary\"",
                               "\n  " + base64(bytes_of(36U) + data) + "\n"),
                           "")
                  .mesh.vertices,
              kThreePoints);
    EXPECT_EQ(read_surface(vtp("header_type=\"UInt64\"", "format=\"binary\"",
                               base64(bytes_of(std::uint64_t{36}) + data)),
                           "")
                  .mesh.vertices,
              kThreePoints);
}

TEST(ReadVtp, ReadsCompressedBlocksOfBigEndianNumbers) {
    const std::string data = floats(std::endian::big);
    const std::string first = deflated(data.substr(0, 20), 15);
    const std::string last = deflated(data.substr(20), 15);
    std::string header;
    for (const std::size_t word :
         {std::size_t{2}, std::size_t{20}, std::size_t{16}, first.size(), last.size()}) {
        header += bytes_of(static_cast<std::uint32_t>(word), std::endian::big);
    }

    const std::string file =
        vtp("byte_order=\"BigEndian\" compressor=\"vtkZLibDataCompressor\" header_type=\"UInt32\"",
            "format=\"binary\"", base64(header) + base64(first + last));

    EXPECT_EQ(read_surface(file, "").mesh.vertices, kThreePoints);
}

TEST(ReadVtp, ReadsAppendedRawAndBase64Data) {
    const std::string block = bytes_of(36U) + floats(std::endian::little);

    const std::string raw =
        vtp("", "format=\"appended\" offset=\"3\"", "",
            "<AppendedData encoding=\"raw\">\n_<&>" + block + "</AppendedData>");
    EXPECT_EQ(read_surface(raw, "").mesh.vertices, kThreePoints);

    const std::string encoded =
        vtp("", "format=\"appended\" offset=\"4\"", "",
            "<AppendedData encoding=\"base64\">_AAAA" + base64(block) + "</AppendedData>");
    EXPECT_EQ(read_surface(encoded, "").mesh.vertices, kThreePoints);
}

TEST(ReadVtp, IgnoresArraysThatNumberTheCells) {
    std::string file = written(cube_with_patches(), MeshFormat::Vtp);
    const auto replace = [&](const std::string& from, const std::string& to) {
        file.replace(file.find(from), from.size(), to);
    };
    replace("Name=\"patch\"", "Name=\"vtkOriginalCellIds\"");

    EXPECT_THAT(read_surface(file, "").mesh.patch, IsEmpty());
}

std::string gifti(const std::string& encoding, const std::string& order, const std::string& points,
                  const std::string& triangles) {
    const auto array = [&](const std::string& intent, const std::string& type,
                           const std::string& rows, const std::string& data) {
        return "<DataArray Intent=\"NIFTI_INTENT_" + intent + "\" DataType=\"NIFTI_TYPE_" + type +
               "\" ArrayIndexingOrder=\"RowMajorOrder\" Dimensionality=\"2\" Dim0=\"" + rows +
               "\" Dim1=\"3\" Encoding=\"" + encoding + "\" Endian=\"" + order + "\"><Data>" +
               data + "</Data></DataArray>";
    };
    return "<?xml version=\"1.0\"?>\n<!DOCTYPE GIFTI SYSTEM \"file:///etc/passwd\">\n<GIFTI>" +
           array("POINTSET", "FLOAT32", "3", points) + array("TRIANGLE", "INT32", "1", triangles) +
           "</GIFTI>";
}

TEST(ReadGifti, ReadsEveryEncoding) {
    const auto ints = [](std::endian order) {
        return bytes_of(0, order) + bytes_of(1, order) + bytes_of(2, order);
    };
    const auto little = std::endian::little;
    const auto big = std::endian::big;

    for (const std::string& file :
         {gifti("ASCII", "LittleEndian", "0 0 0 1 0 0 0 1 2", "0 1 2"),
          gifti("Base64Binary", "BigEndian", base64(floats(big)), base64(ints(big))),
          gifti("GZipBase64Binary", "LittleEndian", base64(deflated(floats(little), 15)),
                base64(gzipped(ints(little))))}) {
        const ReadResult read = read_surface(file, "");

        EXPECT_EQ(read.format, MeshFormat::Gifti);
        EXPECT_EQ(read.mesh.vertices, kThreePoints);
        EXPECT_THAT(read.mesh.triangles, ElementsAre(Triangle{0, 1, 2}));
    }
}

TEST(ReadGifti, RefusesDataInAnotherFile) {
    EXPECT_THAT(error_of(gifti("ExternalFileBinary", "LittleEndian", "", ""), ""),
                HasSubstr("Unsupported: GIfTI: array 'NIFTI_INTENT_POINTSET' is in another file"));
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
