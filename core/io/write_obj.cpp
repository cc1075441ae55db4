#include "core/io/output.h"
#include "core/io/patch_names.h"
#include "core/io/writers.h"

namespace remesh::io {

void write_obj(const SurfaceMesh& surface, std::ostream& out) {
    Output output(out);
    output << "# written by remesh\n";
    for (const auto& v : surface.vertices) {
        output << "v " << v << '\n';
    }
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        // A group may be taken up again, so that the triangles keep their order.
        if (!surface.patch.empty() && (t == 0 || surface.patch[t] != surface.patch[t - 1])) {
            output << "g " << patch_name(surface, surface.patch[t]) << '\n';
        }
        const auto& [a, b, c] = surface.triangles[t];
        output << "f " << a + 1 << ' ' << b + 1 << ' ' << c + 1 << '\n';
    }
}

}  // namespace remesh::io
