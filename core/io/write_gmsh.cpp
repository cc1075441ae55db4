#include <algorithm>

#include "core/io/output.h"
#include "core/io/tet_labels.h"
#include "core/io/writers.h"

/// gmsh's MSH, ASCII. For each region r a volume r with the physical name "region_r" and the part
/// of the boundary that it owns, a surface r with the physical name "boundary_r".
namespace remesh::io {
namespace {

constexpr std::int32_t kTriangle = 2;
constexpr std::int32_t kTetra = 4;

void write_physical_names(const LabelledTets& labelled, Output& output) {
    output << "$PhysicalNames\n" << 2 * labelled.regions.size() << '\n';
    for (const std::int32_t region : labelled.regions) {
        output << "2 " << region << " \"boundary_" << region << "\"\n";
    }
    for (const std::int32_t region : labelled.regions) {
        output << "3 " << region << " \"region_" << region << "\"\n";
    }
    output << "$EndPhysicalNames\n";
}

// The box of the whole mesh will do for every entity: gmsh uses it for display only.
void write_entities(const LabelledTets& labelled, Output& output) {
    const Box box = bounding_box(labelled.mesh.vertices);
    output << "$Entities\n0 0 " << labelled.regions.size() << ' ' << labelled.regions.size()
           << '\n';
    for (const std::int32_t region : labelled.regions) {
        output << region << ' ' << box.low << ' ' << box.high << " 1 " << region << " 0\n";
    }
    for (const std::int32_t region : labelled.regions) {
        output << region << ' ' << box.low << ' ' << box.high << " 1 " << region << " 1 " << region
               << '\n';
    }
    output << "$EndEntities\n";
}

// Writes the cells of each region as a block of their own, numbering them from `first` on.
template <typename Cell, typename RegionOf>
std::size_t write_blocks(const std::vector<Cell>& cells, const LabelledTets& labelled,
                         std::int32_t type, std::size_t first, Output& output, RegionOf region_of) {
    const auto dimension = static_cast<std::int32_t>(std::tuple_size_v<Cell> - 1);
    for (const std::int32_t region : labelled.regions) {
        std::size_t count = 0;
        for (std::size_t i = 0; i < cells.size(); ++i) {
            count += region_of(i) == region ? 1 : 0;
        }
        output << dimension << ' ' << region << ' ' << type << ' ' << count << '\n';
        for (std::size_t i = 0; i < cells.size(); ++i) {
            if (region_of(i) == region) {
                output << first++;
                for (const Index v : cells[i]) {
                    output << ' ' << v + 1;
                }
                output << '\n';
            }
        }
    }
    return first;
}

}  // namespace

void write_msh41(const TetMesh& mesh, std::ostream& out) {
    const LabelledTets labelled(mesh);
    Output output(out);
    output << "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
    write_physical_names(labelled, output);
    write_entities(labelled, output);

    const std::size_t vertices = mesh.vertices.size();
    output << "$Nodes\n1 " << vertices << " 1 " << vertices << "\n3 " << labelled.regions.front()
           << " 0 " << vertices << '\n';
    for (std::size_t v = 1; v <= vertices; ++v) {
        output << v << '\n';
    }
    for (const auto& v : mesh.vertices) {
        output << v << '\n';
    }
    output << "$EndNodes\n";

    const std::size_t elements = labelled.boundary.size() + mesh.tets.size();
    output << "$Elements\n"
           << 2 * labelled.regions.size() << ' ' << elements << " 1 " << elements << '\n';
    const std::size_t first_tet =
        write_blocks(labelled.boundary, labelled, kTriangle, 1, output,
                     [&](std::size_t i) { return labelled.region_of_triangle(i); });
    write_blocks(mesh.tets, labelled, kTetra, first_tet, output,
                 [&](std::size_t i) { return labelled.region_of(i); });
    output << "$EndElements\n";
}

void write_msh22(const TetMesh& mesh, std::ostream& out) {
    const LabelledTets labelled(mesh);
    Output output(out);
    output << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
    write_physical_names(labelled, output);
    output << "$Nodes\n" << mesh.vertices.size() << '\n';
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
        output << v + 1 << ' ' << mesh.vertices[v] << '\n';
    }
    output << "$EndNodes\n$Elements\n" << labelled.boundary.size() + mesh.tets.size() << '\n';
    // Number, type, two tags (physical group and entity), corners.
    std::size_t number = 0;
    for (std::size_t t = 0; t < labelled.boundary.size(); ++t) {
        const std::int32_t region = labelled.region_of_triangle(t);
        const auto& [a, b, c] = labelled.boundary[t];
        output << ++number << ' ' << kTriangle << " 2 " << region << ' ' << region << ' ' << a + 1
               << ' ' << b + 1 << ' ' << c + 1 << '\n';
    }
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const std::int32_t region = labelled.region_of(t);
        const auto& [a, b, c, d] = mesh.tets[t];
        output << ++number << ' ' << kTetra << " 2 " << region << ' ' << region << ' ' << a + 1
               << ' ' << b + 1 << ' ' << c + 1 << ' ' << d + 1 << '\n';
    }
    output << "$EndElements\n";
}

}  // namespace remesh::io
