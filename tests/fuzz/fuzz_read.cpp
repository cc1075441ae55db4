// Feeds bytes to the readers of mesh files. Whatever they are, the answer is a mesh or an Error,
// within the bounds. One program a format: REMESH_FUZZ_FORMAT is the extension that it hints at.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "core/error.h"
#include "core/io/mesh_io.h"

namespace {

// Small, so that a file of a few bytes that asks for gigabytes is found by the time it takes.
constexpr remesh::ReadLimits kLimits{
    .max_bytes = std::uint64_t{8} << 20U, .max_expansion = 100.0, .max_triangles = 1'000'000};

/// What every caller relies on.
bool is_sound(const remesh::SurfaceMesh& mesh) {
    const auto vertices = static_cast<remesh::Index>(mesh.vertices.size());
    for (const auto& triangle : mesh.triangles) {
        for (const remesh::Index corner : triangle) {
            if (corner < 0 || corner >= vertices) {
                return false;
            }
        }
    }
    for (const std::int32_t patch : mesh.patch) {
        if (patch < 0 || (!mesh.patch_names.empty() &&
                          static_cast<std::size_t>(patch) >= mesh.patch_names.size())) {
            return false;
        }
    }
    return mesh.patch.empty() || mesh.patch.size() == mesh.triangles.size();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    try {
        const remesh::ReadResult result = remesh::read_surface(bytes, REMESH_FUZZ_FORMAT, kLimits);
        if (!is_sound(result.mesh)) {
            std::abort();
        }
    } catch (const remesh::Error&) {
    }
    return 0;
}
