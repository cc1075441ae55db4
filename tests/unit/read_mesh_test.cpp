#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/io/mesh_io.h"
#include "tests/unit/mesh_io_helpers.h"

namespace remesh::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::string_view kTetrahedron =
    "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

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

}  // namespace
}  // namespace remesh::testing
