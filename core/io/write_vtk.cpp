#include <bit>
#include <limits>

#include "core/error.h"
#include "core/io/output.h"
#include "core/io/writers.h"

/// Legacy VTK, binary, in the layout of version 3, which every reader knows.
namespace remesh::io {
namespace {

constexpr bool kSwap = must_swap(std::endian::big);

void write_head(const Points& vertices, std::string_view dataset, Output& output) {
    output << "# vtk DataFile Version 3.0\nwritten by remesh\nBINARY\nDATASET " << dataset
           << "\nPOINTS " << vertices.size() << " double\n";
    for (const auto& v : vertices) {
        output.put(v.x(), kSwap);
        output.put(v.y(), kSwap);
        output.put(v.z(), kSwap);
    }
}

template <typename Cell>
void write_cells(const std::vector<Cell>& cells, std::string_view keyword, Output& output) {
    const std::size_t corners = std::tuple_size_v<Cell>;
    const std::size_t size = cells.size() * (corners + 1);
    if (size > std::numeric_limits<std::int32_t>::max()) {
        throw Error(ErrorCode::TooLarge, "legacy VTK can't hold " + grouped(cells.size()) +
                                             " cells: its numbers have 32 bits");
    }
    output << '\n' << keyword << ' ' << cells.size() << ' ' << size << '\n';
    for (const auto& cell : cells) {
        output.put(static_cast<std::int32_t>(corners), kSwap);
        for (const Index v : cell) {
            output.put(v, kSwap);
        }
    }
    output << '\n';
}

void write_labels(const std::vector<std::int32_t>& labels, std::string_view name, Output& output) {
    output << "CELL_DATA " << labels.size() << "\nSCALARS " << name
           << " int 1\nLOOKUP_TABLE default\n";
    for (const std::int32_t label : labels) {
        output.put(label, kSwap);
    }
    output << '\n';
}

void write_sizes(const std::vector<double>& sizes, Output& output) {
    if (sizes.empty()) {
        return;
    }
    output << "POINT_DATA " << sizes.size() << "\nSCALARS h double 1\nLOOKUP_TABLE default\n";
    for (const double size : sizes) {
        output.put(size, kSwap);
    }
    output << '\n';
}

}  // namespace

void write_vtk(const SurfaceMesh& surface, std::ostream& out, const std::vector<double>& sizes) {
    Output output(out);
    write_head(surface.vertices, "POLYDATA", output);
    write_cells(surface.triangles, "POLYGONS", output);
    if (!surface.patch.empty()) {
        write_labels(surface.patch, "patch", output);
    }
    write_sizes(sizes, output);
}

void write_vtk(const TetMesh& mesh, std::ostream& out, const std::vector<double>& sizes) {
    constexpr std::int32_t kTetra = 10;
    Output output(out);
    write_head(mesh.vertices, "UNSTRUCTURED_GRID", output);
    write_cells(mesh.tets, "CELLS", output);
    output << "CELL_TYPES " << mesh.tets.size() << '\n';
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        output.put(kTetra, kSwap);
    }
    output << '\n';
    if (!mesh.region.empty()) {
        write_labels(mesh.region, "region", output);
    }
    write_sizes(sizes, output);
}

}  // namespace remesh::io
