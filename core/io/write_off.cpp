#include "core/io/output.h"
#include "core/io/writers.h"

namespace remesh::io {

void write_off(const SurfaceMesh& surface, std::ostream& out) {
    Output output(out);
    output << "OFF\n" << surface.vertices.size() << ' ' << surface.triangles.size() << " 0\n";
    for (const auto& v : surface.vertices) {
        output << v << '\n';
    }
    for (const auto& [a, b, c] : surface.triangles) {
        output << "3 " << a << ' ' << b << ' ' << c << '\n';
    }
}

}  // namespace remesh::io
