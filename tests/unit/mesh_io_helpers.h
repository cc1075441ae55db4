#pragma once

#include <bit>
#include <cstring>
#include <sstream>
#include <string>
#include <string_view>
#include <zlib.h>

#include "core/error.h"
#include "core/io/mesh_io.h"
#include "tests/support/shapes.h"

namespace remesh::testing {

inline std::string written(const SurfaceMesh& surface, MeshFormat format) {
    std::ostringstream out;
    write_surface(surface, format, out);
    return out.str();
}

inline std::string written(const TetMesh& mesh, MeshFormat format) {
    std::ostringstream out;
    write_tets(mesh, format, out);
    return out.str();
}

/// The error that reading ends with: "InvalidInput: ...", or "none".
inline std::string error_of(std::string_view bytes, std::string_view name,
                            const ReadLimits& limits = {}) {
    try {
        (void)read_surface(bytes, name, limits);
        return "none";
    } catch (const Error& error) {
        const std::string what = error.what();
        switch (error.code()) {
            case ErrorCode::InvalidInput: return "InvalidInput: " + what;
            case ErrorCode::Unsupported: return "Unsupported: " + what;
            case ErrorCode::TooLarge: return "TooLarge: " + what;
            case ErrorCode::Unmeshable:
            case ErrorCode::Cancelled:
            case ErrorCode::Internal: break;
        }
        return "wrong code: " + what;
    }
}

/// \param window_bits  15 for zlib, 31 for gzip
inline std::string deflated(std::string_view bytes, int window_bits) {
    z_stream stream{};
    deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, window_bits, 8, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
    std::string input(bytes);
    stream.next_in = reinterpret_cast<Bytef*>(input.data());
    stream.avail_in = static_cast<uInt>(input.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

inline std::string gzipped(std::string_view bytes) {
    return deflated(bytes, 31);
}

/// The bytes of a number in the given byte order.
template <typename T>
std::string bytes_of(T value, std::endian order = std::endian::little) {
    std::string bytes(sizeof(T), '\0');
    std::memcpy(bytes.data(), &value, sizeof(T));
    return order == std::endian::native ? bytes : std::string(bytes.rbegin(), bytes.rend());
}

inline std::string base64(std::string_view bytes) {
    constexpr std::string_view kAlphabet =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        unsigned bits = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            bits =
                bits * 256 + (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
        }
        for (std::size_t k = 0; k < 4; ++k) {
            const bool is_padding = i + k > bytes.size();
            text += is_padding ? '=' : kAlphabet[(bits >> (18 - 6 * k)) & 63];
        }
    }
    return text;
}

/// The unit cube with its six sides as patches.
inline SurfaceMesh cube_with_patches() {
    SurfaceMesh cube = unit_cube();
    cube.patch_names = {"bottom", "top", "front", "back", "inlet", "outlet"};
    for (std::int32_t t = 0; t < 12; ++t) {
        cube.patch.push_back(t / 2);
    }
    return cube;
}

/// Coordinates that show whether a format keeps all digits.
inline SurfaceMesh awkward_sphere() {
    return transformed(icosphere(1), Eigen::Matrix3d::Identity() / 3.0, {1e-300, -17.1, 1e6});
}

/// The tets of the cube [0, 1]^3 around its diagonal, in two regions.
inline TetMesh two_regions() {
    TetMesh mesh;
    mesh.vertices = unit_cube().vertices;
    mesh.tets = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                 {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
    mesh.region = {1, 1, 1, 2, 2, 2};
    return mesh;
}

}  // namespace remesh::testing
