#include <algorithm>

#include "core/io/output.h"
#include "core/io/tet_labels.h"
#include "core/io/writers.h"

/// gmsh's MSH, ASCII. For each region r a volume r with the physical name "region_r"; for each
/// label of boundary triangles a surface with the name of its patch, or "boundary_r" for region r.
namespace remesh::io {
namespace {

constexpr std::int32_t kTriangle = 2;
constexpr std::int32_t kTetra = 4;

void write_physical_names(const LabelledTets& labelled, Output& output) {
    output << "$PhysicalNames\n" << labelled.labels.size() + labelled.regions.size() << '\n';
    for (const std::int32_t label : labelled.labels) {
        output << "2 " << label << " \"" << labelled.name_of(label) << "\"\n";
    }
    for (const std::int32_t region : labelled.regions) {
        output << "3 " << region << " \"region_" << region << "\"\n";
    }
    output << "$EndPhysicalNames\n";
}

// The box of the whole mesh will do for every entity: gmsh uses it for display only.
void write_entities(const LabelledTets& labelled, Output& output) {
    const Box box = bounding_box(labelled.mesh.vertices);
    output << "$Entities\n0 0 " << labelled.labels.size() << ' ' << labelled.regions.size() << '\n';
    for (const std::int32_t label : labelled.labels) {
        output << label << ' ' << box.low << ' ' << box.high << " 1 " << label << " 0\n";
    }
    for (const std::int32_t region : labelled.regions) {
        const auto around = labelled.labels_around(region);
        output << region << ' ' << box.low << ' ' << box.high << " 1 " << region << ' '
               << around.size();
        for (const std::int32_t label : around) {
            output << ' ' << label;
        }
        output << '\n';
    }
    output << "$EndEntities\n";
}

// Writes the cells of each label as a block of their own, numbering them from `first` on.
template <typename Cell, typename LabelOf>
std::size_t write_blocks(const std::vector<Cell>& cells, const std::vector<std::int32_t>& labels,
                         std::int32_t type, std::size_t first, Output& output, LabelOf label_of) {
    const auto dimension = static_cast<std::int32_t>(std::tuple_size_v<Cell> - 1);
    std::vector<std::vector<std::size_t>> cells_of(labels.size());
    for (std::size_t i = 0; i < cells.size(); ++i) {
        const auto place = std::lower_bound(labels.begin(), labels.end(), label_of(i));
        cells_of[static_cast<std::size_t>(place - labels.begin())].push_back(i);
    }
    for (std::size_t k = 0; k < labels.size(); ++k) {
        output << dimension << ' ' << labels[k] << ' ' << type << ' ' << cells_of[k].size() << '\n';
        for (const std::size_t i : cells_of[k]) {
            output << first++;
            for (const Index v : cells[i]) {
                output << ' ' << v + 1;
            }
            output << '\n';
        }
    }
    return first;
}

}  // namespace

void write_msh41(const TetMesh& mesh, std::ostream& out, const SurfaceMesh& patches) {
    const LabelledTets labelled(mesh, patches);
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
           << labelled.labels.size() + labelled.regions.size() << ' ' << elements << " 1 "
           << elements << '\n';
    const std::size_t first_tet =
        write_blocks(labelled.boundary, labelled.labels, kTriangle, 1, output,
                     [&](std::size_t i) { return labelled.label_of(i); });
    write_blocks(mesh.tets, labelled.regions, kTetra, first_tet, output,
                 [&](std::size_t i) { return labelled.region_of(i); });
    output << "$EndElements\n";
}

void write_msh22(const TetMesh& mesh, std::ostream& out, const SurfaceMesh& patches) {
    const LabelledTets labelled(mesh, patches);
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
        const std::int32_t label = labelled.label_of(t);
        const auto& [a, b, c] = labelled.boundary[t];
        output << ++number << ' ' << kTriangle << " 2 " << label << ' ' << label << ' ' << a + 1
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
