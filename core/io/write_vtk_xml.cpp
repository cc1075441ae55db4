#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <vector>
#include <zlib.h>

#include "core/error.h"
#include "core/io/base64.h"
#include "core/io/output.h"
#include "core/io/patch_names.h"
#include "core/io/writers.h"

/// VTK's XML formats: little-endian, zlib, base64 in place.
namespace remesh::io {
namespace {

constexpr std::size_t kBlockSize = std::size_t{1} << 17;
constexpr bool kSwap = must_swap(std::endian::little);

// Compresses an array as it's put in, block by block: never more than one block of it is in
// memory uncompressed.
class CompressedArray {
public:
    template <typename T>
    void put(T value) {
        const T stored = kSwap ? byte_swapped(value) : value;
        const auto bytes = std::bit_cast<std::array<char, sizeof(T)>>(stored);
        block_.append(bytes.data(), bytes.size());
        if (block_.size() >= kBlockSize) {
            compress_block();
        }
    }

    // A header of 64-bit words, then the blocks; each is a base64 text of its own.
    void write(Output& output) {
        const std::size_t last = block_.size();
        if (last > 0) {
            compress_block();
        }
        std::string header;
        append_word(sizes_.size(), header);
        append_word(kBlockSize, header);
        append_word(last, header);  // 0: the last one is whole.
        for (const std::uint64_t size : sizes_) {
            append_word(size, header);
        }
        write_base64(header, output);
        write_base64(compressed_, output);
        output << '\n';
    }

private:
    static void append_word(std::uint64_t word, std::string& bytes) {
        const auto stored = std::bit_cast<std::array<char, 8>>(kSwap ? byte_swapped(word) : word);
        bytes.append(stored.data(), stored.size());
    }

    static void write_base64(std::string_view bytes, Output& output) {
        constexpr std::size_t kChunk = 3 << 14;  // Whole groups of 3: no padding in between.
        std::string text;
        for (std::size_t at = 0; at < bytes.size(); at += kChunk) {
            text.clear();
            append_base64(bytes.substr(at, kChunk), text);
            output << text;
        }
    }

    void compress_block() {
        uLongf size = compressBound(static_cast<uLong>(block_.size()));
        const std::size_t before = compressed_.size();
        compressed_.resize(before + size);
        const int status = compress2(reinterpret_cast<Bytef*>(compressed_.data() + before), &size,
                                     reinterpret_cast<const Bytef*>(block_.data()),
                                     static_cast<uLong>(block_.size()), Z_BEST_SPEED);
        if (status != Z_OK) {
            throw Error(ErrorCode::Internal, "zlib can't compress: " + std::to_string(status));
        }
        compressed_.resize(before + size);
        sizes_.push_back(size);
        block_.clear();
    }

    std::string block_{};
    std::string compressed_{};
    std::vector<std::uint64_t> sizes_{};
};

// Calls fill(array) and writes what it put there.
template <typename Fill>
void write_array(std::string_view type, std::string_view name, int components, Output& output,
                 Fill fill) {
    output << "<DataArray type=\"" << type << "\" Name=\"" << name << "\" NumberOfComponents=\""
           << std::int32_t{components} << "\" format=\"binary\">\n";
    CompressedArray array;
    fill(array);
    array.write(output);
    output << "</DataArray>\n";
}

void write_head(std::string_view type, Output& output) {
    output << "<?xml version=\"1.0\"?>\n<VTKFile type=\"" << type
           << "\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" "
              "compressor=\"vtkZLibDataCompressor\">\n<"
           << type << ">\n";
}

void write_points(const Points& vertices, Output& output) {
    output << "<Points>\n";
    write_array("Float64", "Points", 3, output, [&](CompressedArray& array) {
        for (const auto& v : vertices) {
            array.put(v.x());
            array.put(v.y());
            array.put(v.z());
        }
    });
    output << "</Points>\n";
}

template <typename Cell>
void write_cells(const std::vector<Cell>& cells, Output& output) {
    write_array("Int32", "connectivity", 1, output, [&](CompressedArray& array) {
        for (const auto& cell : cells) {
            for (const Index v : cell) {
                array.put(v);
            }
        }
    });
    write_array("Int64", "offsets", 1, output, [&](CompressedArray& array) {
        for (std::size_t i = 1; i <= cells.size(); ++i) {
            array.put(static_cast<std::int64_t>(i * std::tuple_size_v<Cell>));
        }
    });
}

void write_labels(const std::vector<std::int32_t>& labels, std::string_view name, Output& output) {
    if (labels.empty()) {
        return;
    }
    output << "<CellData Scalars=\"" << name << "\">\n";
    write_array("Int32", name, 1, output, [&](CompressedArray& array) {
        for (const std::int32_t label : labels) {
            array.put(label);
        }
    });
    output << "</CellData>\n";
}

void write_sizes(const std::vector<double>& sizes, Output& output) {
    if (sizes.empty()) {
        return;
    }
    output << "<PointData Scalars=\"h\">\n";
    write_array("Float64", "h", 1, output, [&](CompressedArray& array) {
        for (const double size : sizes) {
            array.put(size);
        }
    });
    output << "</PointData>\n";
}

// A string array stands in the file as the codes of its characters, each string ended by a 0.
void write_patch_names(const SurfaceMesh& surface, Output& output) {
    if (surface.patch_names.empty() || surface.patch.empty()) {
        return;
    }
    output << "<FieldData>\n<Array type=\"String\" Name=\"patch_names\" NumberOfTuples=\""
           << patch_count(surface) << "\" format=\"ascii\">\n";
    for (std::int32_t i = 0; i < patch_count(surface); ++i) {
        for (const char c : patch_name(surface, i)) {
            output << std::int32_t{static_cast<unsigned char>(c)} << ' ';
        }
        output << "0\n";
    }
    output << "</Array>\n</FieldData>\n";
}

}  // namespace

void write_vtp(const SurfaceMesh& surface, std::ostream& out, const std::vector<double>& sizes) {
    Output output(out);
    write_head("PolyData", output);
    write_patch_names(surface, output);
    output << "<Piece NumberOfPoints=\"" << surface.vertices.size()
           << "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\""
           << surface.triangles.size() << "\">\n";
    write_sizes(sizes, output);
    write_points(surface.vertices, output);
    output << "<Polys>\n";
    write_cells(surface.triangles, output);
    output << "</Polys>\n";
    write_labels(surface.patch, "patch", output);
    output << "</Piece>\n</PolyData>\n</VTKFile>\n";
}

void write_vtu(const TetMesh& mesh, std::ostream& out, const std::vector<double>& sizes) {
    constexpr std::uint8_t kTetra = 10;
    Output output(out);
    write_head("UnstructuredGrid", output);
    output << "<Piece NumberOfPoints=\"" << mesh.vertices.size() << "\" NumberOfCells=\""
           << mesh.tets.size() << "\">\n";
    write_sizes(sizes, output);
    write_points(mesh.vertices, output);
    output << "<Cells>\n";
    write_cells(mesh.tets, output);
    write_array("UInt8", "types", 1, output, [&](CompressedArray& array) {
        for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
            array.put(kTetra);
        }
    });
    output << "</Cells>\n";
    write_labels(mesh.region, "region", output);
    output << "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

}  // namespace remesh::io
