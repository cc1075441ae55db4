#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/io/surface_builder.h"

namespace remesh::io {

/// Cells as VTK keeps them: cell i has the corners [offsets[i], offsets[i + 1]), where the first
/// offset is 0. No cells: no offsets at all.
struct VtkCells {
    std::vector<std::int64_t> offsets{};
    std::vector<std::int64_t> corners{};
};

[[nodiscard]] std::int64_t cell_count(const VtkCells& cells);

/// One piece of polygonal data as it stands in a file, nothing of it checked.
struct VtkPiece {
    std::vector<double> points{};  ///< 3 a vertex.
    VtkCells polygons{};
    VtkCells strips{};
    std::int64_t other_cells = 0;        ///< Vertices and lines, which come before polygons.
    std::vector<std::int64_t> labels{};  ///< Patch of every cell, the others too; or empty.
};

/// Checks the piece and adds its faces to the surface.
/// \throws Error{InvalidInput} for offsets that aren't in order or an index out of range
void add_piece(const VtkPiece& piece, const std::string& format, SurfaceBuilder& builder);

/// Whether numbers of cells can be patches: few enough of them to be parts of the surface, not
/// numbers of the cells themselves.
[[nodiscard]] bool can_be_patches(const std::vector<std::int64_t>& labels);

}  // namespace remesh::io
