#include "core/io/output.h"
#include "core/io/tet_labels.h"
#include "core/io/writers.h"

namespace remesh::io {

void write_medit(const TetMesh& mesh, std::ostream& out, const SurfaceMesh& patches) {
    const LabelledTets labelled(mesh, patches);
    Output output(out);
    output << "MeshVersionFormatted 2\nDimension 3\nVertices\n" << mesh.vertices.size() << '\n';
    for (const auto& v : mesh.vertices) {
        output << v << " 0\n";
    }
    output << "Triangles\n" << labelled.boundary.size() << '\n';
    for (std::size_t t = 0; t < labelled.boundary.size(); ++t) {
        const auto& [a, b, c] = labelled.boundary[t];
        output << a + 1 << ' ' << b + 1 << ' ' << c + 1 << ' ' << labelled.label_of(t) << '\n';
    }
    output << "Tetrahedra\n" << mesh.tets.size() << '\n';
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const auto& [a, b, c, d] = mesh.tets[t];
        output << a + 1 << ' ' << b + 1 << ' ' << c + 1 << ' ' << d + 1 << ' '
               << labelled.region_of(t) << '\n';
    }
    output << "End\n";
}

}  // namespace remesh::io
