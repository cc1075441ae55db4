#include <bit>

#include "core/io/output.h"
#include "core/io/patch_names.h"
#include "core/io/writers.h"

namespace remesh::io {

// In double precision, so that the file holds the very surface that was checked.
void write_ply(const SurfaceMesh& surface, std::ostream& out, const std::vector<double>& sizes) {
    constexpr bool kSwap = must_swap(std::endian::little);
    const bool has_patches = !surface.patch.empty();
    Output output(out);
    output << "ply\nformat binary_little_endian 1.0\ncomment written by remesh\n";
    if (has_patches) {
        for (std::int32_t i = 0; i < patch_count(surface); ++i) {
            output << "comment patch " << patch_name(surface, i) << '\n';
        }
    }
    output << "element vertex " << surface.vertices.size()
           << "\nproperty double x\nproperty double y\nproperty double z\n"
           << (sizes.empty() ? "" : "property double h\n") << "element face "
           << surface.triangles.size() << "\nproperty list uchar int vertex_indices\n"
           << (has_patches ? "property int patch\n" : "") << "end_header\n";
    for (std::size_t i = 0; i < surface.vertices.size(); ++i) {
        for (const double coordinate : surface.vertices[i]) {
            output.put(coordinate, kSwap);
        }
        if (!sizes.empty()) {
            output.put(sizes[i], kSwap);
        }
    }
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        output.put(std::uint8_t{3}, kSwap);
        for (const Index v : surface.triangles[t]) {
            output.put(v, kSwap);
        }
        if (has_patches) {
            output.put(surface.patch[t], kSwap);
        }
    }
}

}  // namespace remesh::io
