#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/unit/mesh_io_helpers.h"

namespace remesh::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr const char* kInvalid = "InvalidInput: ";

TEST(ReadSurface, RefusesAnEmptyFile) {
    EXPECT_EQ(error_of("", "a.stl"), "InvalidInput: the file is empty");
    EXPECT_EQ(error_of(gzipped(""), "a.stl.gz"), "InvalidInput: the file is empty");
}

TEST(ReadSurface, RefusesBytesOfNoFormat) {
    EXPECT_THAT(error_of("what is this?", "a.txt"), StartsWith("InvalidInput: the file's format"));
    EXPECT_THAT(error_of("what is this?", "a.ply"), StartsWith("InvalidInput: the file is named"));
}

TEST(ReadSurface, NamesLabelMapsArchivesPicturesAndPages) {
    const auto at = [](std::size_t offset, const std::string& bytes) {
        std::string file(offset + 512, '\0');
        return file.replace(offset, bytes.size(), bytes);
    };

    EXPECT_THAT(error_of(at(344, "n+1"), "a.nii"), HasSubstr("(NIfTI): label maps are not read"));
    EXPECT_THAT(error_of(gzipped(at(344, "n+1")), "a.nii.gz"), HasSubstr("(NIfTI)"));
    EXPECT_THAT(error_of("NRRD0004\ntype: uchar\n", "a.nhdr"), HasSubstr("(NRRD)"));
    EXPECT_THAT(error_of("ObjectType = Image\nDimSize = 1 1 1\n", "a.mhd"),
                HasSubstr("(MetaImage)"));
    EXPECT_THAT(error_of("#INRIMAGE-4#{\nXDIM=1\n", "a.inr"), HasSubstr("(INRIMAGE)"));
    EXPECT_THAT(error_of(at(252, "\xef\xff\xe9\xb0"), "a.gipl"), HasSubstr("(GIPL)"));
    EXPECT_THAT(error_of(at(128, "DICM"), "a.stl"), HasSubstr("DICOM"));
    EXPECT_THAT(error_of("PK\x03\x04 and more", "a.stl"),
                StartsWith("Unsupported: the file is a ZIP"));
    EXPECT_THAT(error_of("\xff\xd8\xff and more", "a.stl"), HasSubstr("JPEG"));
    EXPECT_THAT(error_of("<!DOCTYPE html><html>", "a.stl"), HasSubstr("web page"));
    EXPECT_THAT(error_of("$MeshFormat\n2.2 0 8\n", "a.msh"), HasSubstr("gmsh"));
    EXPECT_THAT(error_of("<VTKFile type=\"UnstructuredGrid\"></VTKFile>", "a.vtu"),
                HasSubstr("'UnstructuredGrid'; only PolyData"));
}

TEST(ReadSurface, RefusesFilesBeyondTheLimits) {
    const std::string ply = written(icosphere(1), MeshFormat::Ply);

    EXPECT_THAT(error_of(ply, "", {.max_bytes = 100}), StartsWith("TooLarge: "));
    EXPECT_THAT(error_of(ply, "", {.max_triangles = 79}),
                HasSubstr("TooLarge: PLY holds more than the 79 triangles"));
    EXPECT_EQ(error_of(ply, "", {.max_triangles = 80}), "none");
}

TEST(ReadGzip, RefusesBombsWithoutInflatingThemWholly) {
    const std::string bomb = gzipped("ply\n" + std::string(std::size_t{20} << 20, ' '));

    EXPECT_THAT(error_of(bomb, "a.ply.gz"), StartsWith("TooLarge: "));
    EXPECT_THAT(error_of(bomb, "a.ply.gz", {.max_bytes = 1'000'000}), HasSubstr("1,000,000 bytes"));
}

TEST(ReadGzip, RefusesTruncatedDamagedAndNestedData) {
    const std::string plain = written(icosphere(2), MeshFormat::Off);
    const std::string packed = gzipped(plain);
    std::string damaged = packed;
    damaged[damaged.size() / 2] = static_cast<char>(~damaged[damaged.size() / 2]);

    EXPECT_THAT(error_of(packed.substr(0, packed.size() / 2), ""), HasSubstr("ends early"));
    EXPECT_THAT(error_of(damaged, ""), StartsWith(kInvalid));
    EXPECT_THAT(error_of(gzipped(packed), ""), HasSubstr("gzipped twice"));
}

TEST(ReadGzip, ReadsAllMembers) {
    const std::string plain = written(icosphere(1), MeshFormat::Off);

    EXPECT_EQ(error_of(gzipped(plain.substr(0, 100)) + gzipped(plain.substr(100)), ""), "none");
}

std::string stl_with_count(std::uint32_t count) {
    std::string stl = written(unit_cube(), MeshFormat::Stl);
    return stl.replace(80, 4, bytes_of(count));
}

TEST(ReadStl, SaysHowManyTrianglesAreThere) {
    EXPECT_EQ(error_of(stl_with_count(4'000'000), "a.stl"),
              "InvalidInput: STL says 4,000,000 triangles but holds 12");
    EXPECT_EQ(error_of(stl_with_count(0xFFFFFFFF), "a.stl"),
              "InvalidInput: STL says 4,294,967,295 triangles but holds 12");
    EXPECT_EQ(error_of(stl_with_count(3), "a.stl"),
              "InvalidInput: STL says 3 triangles but holds 12");
    EXPECT_EQ(error_of(stl_with_count(0), "a.stl"),
              "InvalidInput: STL says 0 triangles but holds 12");
    EXPECT_EQ(error_of(stl_with_count(12).substr(0, 584), "a.stl"),
              "InvalidInput: STL says 12 triangles but holds 10");
    EXPECT_THAT(error_of(std::string(84, '\0'), "a.stl"), HasSubstr("STL holds no triangles"));
    EXPECT_THAT(error_of("solid x\nendsolid x\n", "a.stl"), HasSubstr("STL holds no triangles"));
}

TEST(ReadStl, NamesTheLineOfWhatIsWrongInText) {
    const std::string start = "solid a\nfacet normal 0 0 1\nouter loop\n";

    EXPECT_EQ(error_of(start + "vertex 1,5 2,5 0\n", "a.stl"),
              "InvalidInput: STL, line 4: '1,5' has a decimal comma; numbers need a decimal point");
    EXPECT_EQ(error_of(start + "vertex 1 2\nvertex", "a.stl"),
              "InvalidInput: STL, line 5: 'vertex' isn't a number");
    EXPECT_THAT(error_of(start + "vertex 1 2 3\n", "a.stl"), HasSubstr("ends inside a facet"));
    EXPECT_THAT(
        error_of(start + "vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet", "a.stl"),
        HasSubstr("the file was cut off after 1 triangle"));
}

TEST(ReadOff, SaysWhatIsMissingOrOutOfRange) {
    const std::string points = "0 0 0\n1 0 0\n0 1 0\n";

    EXPECT_EQ(error_of("OFF\n4000000000 4000000000 0\n0 0 0\n", ""),
              "InvalidInput: OFF says 4,000,000,000 vertices but holds 1");
    EXPECT_EQ(error_of("OFF\n3 400 0\n" + points + "3 0 1 2\n", ""),
              "InvalidInput: OFF says 400 faces but holds 1");
    EXPECT_THAT(error_of("OFF\n3 1 0\n" + points + "3 0 1 99\n", ""),
                HasSubstr("line 6: face 1 refers to vertex 99, but there are 3"));
    EXPECT_THAT(error_of("OFF\n3 1 0\n" + points + "3 0 1 -2\n", ""), HasSubstr("vertex -2"));
    EXPECT_THAT(error_of("OFF\n3 1 0\n" + points + "2000000000 0 1 2\n", ""),
                HasSubstr("face 1 says 2,000,000,000 corners, more than the rest"));
    EXPECT_THAT(error_of("OFF\n-3 1 0\n", ""), HasSubstr("number of vertices is negative"));
    EXPECT_THAT(error_of("OFF BINARY\n", ""), StartsWith("Unsupported: OFF: the binary"));
    EXPECT_THAT(error_of("4OFF\n1 1 1\n", ""), StartsWith("Unsupported: "));
    EXPECT_THAT(error_of("OFF\n99999999999999999999 1 0\n", ""), HasSubstr("below 2^63"));
}

TEST(ReadObj, SaysWhatIsMissingOrOutOfRange) {
    const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    EXPECT_THAT(error_of(points + "f 0 1 2\n", "a.obj"),
                HasSubstr("line 4: a face refers to vertex 0"));
    EXPECT_THAT(error_of(points + "f 1 2 4\n", "a.obj"), HasSubstr("but there are 3 vertices"));
    EXPECT_THAT(error_of(points + "f 1 2 -4\n", "a.obj"), HasSubstr("vertex -4 from the end"));
    EXPECT_THAT(error_of(points + "f 1 2 9223372036854775807\n", "a.obj"), StartsWith(kInvalid));
    EXPECT_THAT(error_of(points + "f 1 2 -9223372036854775808\n", "a.obj"), StartsWith(kInvalid));
    EXPECT_THAT(error_of(points + "f 1 2 x\n", "a.obj"), HasSubstr("isn't a corner"));
    EXPECT_THAT(error_of(points + "l 1 2\n", "a.obj"), HasSubstr("1 line but no faces"));
}

std::string ply(const std::string& elements, const std::string& data) {
    return "ply\nformat binary_little_endian 1.0\n" + elements + "end_header\n" + data;
}

TEST(ReadPly, SaysWhatIsWrong) {
    const std::string xyz = "property uchar x\nproperty uchar y\nproperty uchar z\n";
    const std::string three = "element vertex 3\n" + xyz;
    const std::string face = "element face 1\nproperty list char int vertex_indices\n";
    const std::string points(9, '\1');

    EXPECT_THAT(error_of("ply\nformat ascii 1.0\n", ""), HasSubstr("no end_header"));
    EXPECT_THAT(error_of(ply("element vertex 4000000000\n" + xyz, points), ""),
                HasSubstr("says 4,000,000,000 of 'vertex' but only 9 bytes"));
    EXPECT_THAT(error_of(ply(three + face, points + "\xff"), ""),
                HasSubstr("has -1 items (face 1)"));
    EXPECT_THAT(error_of(ply(three + face, points + "\x7f"), ""),
                HasSubstr("127 items, more than the file holds"));
    EXPECT_THAT(error_of(ply(three + face, points + "\3" + std::string(12, '\x7f')), ""),
                HasSubstr("refers to vertex 2,139,062,143"));
    EXPECT_THAT(error_of(ply(three, points), ""), HasSubstr("PLY holds no triangles, only 3"));
    EXPECT_THAT(error_of(ply("element vertex 1\nproperty float x\n", "1234"), ""),
                HasSubstr("no property y"));
    EXPECT_THAT(error_of(ply("element vertex -1\n", ""), ""), HasSubstr("is negative: -1"));
    EXPECT_THAT(error_of(ply("element nothing 9000000000000000000\n", ""), ""),
                HasSubstr("no triangles"));
    EXPECT_THAT(error_of(ply("property float x\n", ""), ""), HasSubstr("before the first element"));
    EXPECT_THAT(error_of(ply("element vertex 1\nproperty half x\n", ""), ""),
                HasSubstr("'half' isn't a type"));
}

TEST(ReadVtk, SaysWhatIsWrong) {
    const std::string head = "# vtk DataFile Version 4.2\nt\nASCII\nDATASET ";
    const std::string points = head + "POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n";

    EXPECT_THAT(error_of(head + "STRUCTURED_POINTS\n", ""), StartsWith("Unsupported: VTK: "));
    EXPECT_THAT(error_of(head + "POLYDATA\nPOINTS 999999999999 float\n0 0 0", ""),
                HasSubstr("says 999,999,999,999 points but only"));
    EXPECT_THAT(error_of(points + "POLYGONS 1 4\n3 0 1 3\n", ""),
                HasSubstr("refers to point 3, but there are 3"));
    EXPECT_THAT(error_of(points + "POLYGONS 1 4\n9 0 1 2\n", ""), HasSubstr("says 9 corners"));
    EXPECT_THAT(error_of(points + "POLYGONS 2 4\n3 0 1 2\n", ""),
                HasSubstr("cell 2 of 2 is missing"));
    EXPECT_THAT(error_of(points + "POLYGONS 2 3\nOFFSETS vtktypeint64\n0 -3\nCONNECTIVITY "
                                  "vtktypeint64\n0 1 2\n",
                         ""),
                HasSubstr("aren't in order"));
    EXPECT_THAT(error_of(points + "POLYGONS 2 3\nOFFSETS vtktypeint64\n0 9\nCONNECTIVITY "
                                  "vtktypeint64\n0 1 2\n",
                         ""),
                HasSubstr("9 corners but only 3"));
}

TEST(ReadVtp, SaysWhatIsWrong) {
    const auto file = [](const std::string& attributes, const std::string& counts,
                         const std::string& array, const std::string& data) {
        return "<VTKFile type=\"PolyData\" " + attributes + "><PolyData><Piece " + counts +
               "><Points><DataArray type=\"Float32\" Name=\"P\" " + array + ">" + data +
               "</DataArray></Points></Piece></PolyData></VTKFile>";
    };
    const std::string zlib = "compressor=\"vtkZLibDataCompressor\"";
    const std::string three = "NumberOfPoints=\"3\"";
    const std::string binary = "format=\"binary\"";
    const auto words = [](auto... values) {
        return base64((bytes_of(static_cast<std::uint32_t>(values)) + ...));
    };

    EXPECT_THAT(error_of("<VTKFile type=\"PolyData\"><PolyData>", ""),
                HasSubstr("well-formed XML"));
    EXPECT_THAT(error_of(file("", "NumberOfPoints=\"-3\"", binary, ""), ""),
                HasSubstr("not a count"));
    EXPECT_THAT(error_of(file("", three, "format=\"ascii\"", "1 2 3"), ""),
                HasSubstr("says 3 points but holds 3 coordinates"));
    EXPECT_THAT(error_of(file("", three, binary, words(4'000'000'000U)), ""),
                HasSubstr("ends early"));
    EXPECT_THAT(error_of(file(zlib, three, binary, words(4'000'000'000U, 1, 1)), ""),
                HasSubstr("ends early"));
    EXPECT_THAT(error_of(file(zlib, three, binary, words(1, 4'000'000'000U, 0, 3) + "AAAA"), ""),
                HasSubstr("can't hold 4,000,000,000 bytes in 3"));
    EXPECT_THAT(error_of(file(zlib, three, binary, words(1, 36, 0, 3) + "AAAA"), ""),
                HasSubstr("is damaged"));
    EXPECT_THAT(error_of(file("compressor=\"vtkLZ4DataCompressor\"", three, binary, "AAAA"), ""),
                StartsWith("Unsupported: VTP: array 'P' is compressed by 'vtkLZ4"));
    EXPECT_THAT(error_of(file("", three, "format=\"appended\" offset=\"7\"", ""), ""),
                HasSubstr("beyond the end"));
    EXPECT_THAT(error_of(file("", three, "format=\"hex\"", ""), ""), HasSubstr("format 'hex'"));
}

TEST(ReadVtp, RefusesMoreElementsThanAnyMeshHas) {
    std::string file = "<VTKFile type=\"PolyData\">";
    for (int i = 0; i < 200'000; ++i) {
        file += "<a/>";
    }

    EXPECT_THAT(error_of(file + "</VTKFile>", ""), StartsWith("TooLarge: VTP: more than 200,000"));
}

TEST(ReadVtp, RefusesManyPiecesInTheSameBytes) {
    std::string file = "<VTKFile type=\"PolyData\"><PolyData>";
    for (int i = 0; i < 1'000; ++i) {
        file +=
            "<Piece NumberOfPoints=\"10000\"><Points><DataArray type=\"Int8\" format=\"appended\" "
            "offset=\"0\"/></Points></Piece>";
    }
    file += "</PolyData><AppendedData encoding=\"raw\">_" + bytes_of(30'000U) +
            std::string(30'000, '\0') + "</AppendedData></VTKFile>";

    EXPECT_THAT(error_of(file, "", {.max_expansion = 20}), StartsWith("TooLarge: "));
}

struct NamedFile {
    std::string name{};
    std::string bytes{};
};

// Small valid files of every format, in several variants.
std::vector<NamedFile> valid_files() {
    const SurfaceMesh cube = cube_with_patches();
    std::vector<NamedFile> files;
    for (const auto format : {MeshFormat::Stl, MeshFormat::Ply, MeshFormat::Off, MeshFormat::Obj,
                              MeshFormat::Vtp, MeshFormat::Vtk}) {
        files.push_back({std::string(format_extension(format)), written(cube, format)});
    }
    files.push_back({"a.off.gz", gzipped(files[2].bytes)});
    files.push_back(
        {"a.stl",
         "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
         "endloop\nendfacet\nendsolid a\n"});
    files.push_back(
        {"a.ply",
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
         "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
         "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"});
    files.push_back(
        {"a.vtk",
         "# vtk DataFile Version 5.1\nt\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 "
         "0\n"
         "POLYGONS 2 3\nOFFSETS vtktypeint64\n0 3\nCONNECTIVITY vtktypeint64\n0 1 2\n"
         "CELL_DATA 1\nSCALARS s int 1\nLOOKUP_TABLE default\n1\nFIELD f 1\na 1 1 double\n1\n"});
    files.push_back(
        {"a.gii",
         "<GIFTI><DataArray Intent=\"NIFTI_INTENT_POINTSET\" DataType=\"NIFTI_TYPE_FLOAT32\" "
         "Dim0=\"3\" Dim1=\"3\" Encoding=\"GZipBase64Binary\" Endian=\"BigEndian\"><Data>" +
             base64(deflated(std::string(36, '\0'), 15)) +
             "</Data></DataArray><DataArray Intent=\"NIFTI_INTENT_TRIANGLE\" "
             "DataType=\"NIFTI_TYPE_INT32\" Dim0=\"1\" Dim1=\"3\" "
             "Encoding=\"Base64Binary\"><Data>" +
             base64(std::string(12, '\0')) + "</Data></DataArray></GIFTI>"});
    files.push_back(
        {"a.vtp",
         "<VTKFile type=\"PolyData\" header_type=\"UInt64\"><PolyData><Piece NumberOfPoints=\"3\" "
         "NumberOfPolys=\"1\"><Points><DataArray type=\"Float32\" format=\"appended\" "
         "offset=\"0\"/>"
         "</Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\" format=\"appended\" "
         "offset=\"44\"/><DataArray type=\"Int8\" Name=\"offsets\" format=\"ascii\">3</DataArray>"
         "</Polys></Piece></PolyData><AppendedData encoding=\"raw\">_" +
             bytes_of(std::uint64_t{36}) + std::string(36, '\0') + bytes_of(std::uint64_t{12}) +
             std::string(12, '\0') + "</AppendedData></VTKFile>"});
    return files;
}

std::string mutated(std::string file, std::mt19937& random) {
    const auto below = [&](std::size_t n) { return random() % n; };
    const std::size_t changes = 1 + below(4);
    for (std::size_t i = 0; i < changes && !file.empty(); ++i) {
        const std::size_t at = below(file.size());
        switch (below(6)) {
            case 0: file.resize(at); break;
            case 1: file[at] = static_cast<char>(random()); break;
            case 2: file[at] = static_cast<char>(file[at] ^ (1 << below(8))); break;
            case 3: file.insert(at, file, below(file.size()), below(64)); break;
            case 4: file.erase(at, 1 + below(16)); break;
            default: file[at] = "0123456789-.,\n\xff"[below(15)]; break;
        }
    }
    return file;
}

TEST(ReadSurface, EndsEveryMutationOfAValidFileWithAMeshOrAnError) {
    const ReadLimits limits{.max_bytes = 1 << 22, .max_triangles = 1'000'000};
    const auto files = valid_files();
    for (std::size_t i = 0; i < files.size(); ++i) {
        const auto& [name, bytes] = files[i];
        ASSERT_EQ(error_of(bytes, name, limits), "none") << "file " << i;
        std::mt19937 random(static_cast<unsigned>(i));
        for (int round = 0; round < 1'000; ++round) {
            const std::string file = mutated(bytes, random);

            // Anything but remesh::Error, which error_of() takes, fails the test.
            ASSERT_NO_THROW({
                ASSERT_THAT(error_of(file, name, limits), Not(StartsWith("wrong code")))
                    << name << ", file " << i << ", round " << round;
            });
        }
    }
}

}  // namespace
}  // namespace remesh::testing
