#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh::io {

/// A tet mesh with what solvers ask for beside the tets: its boundary, and labels of both. A
/// boundary triangle has the label of the region that it bounds.
struct LabelledTets {
    /// \throws Error{InvalidInput} if a region is below 1, which gmsh and FreeFem don't allow
    explicit LabelledTets(const TetMesh& tets);

    [[nodiscard]] std::int32_t region_of(std::size_t tet) const {
        return mesh.region.empty() ? 1 : mesh.region[tet];
    }
    [[nodiscard]] std::int32_t region_of_triangle(std::size_t triangle) const {
        return region_of(static_cast<std::size_t>(owner[triangle]));
    }

    const TetMesh& mesh;
    std::vector<Index> owner{};           ///< Tet of each boundary triangle.
    std::vector<Triangle> boundary{};     ///< Facing outward.
    std::vector<std::int32_t> regions{};  ///< All that occur, in order.
};

}  // namespace remesh::io
