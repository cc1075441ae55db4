#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh::io {

/// A tet mesh with what solvers ask for beside the tets: its boundary, and labels of both. A
/// boundary triangle has its patch + 1 for a label, or else that of the region that it bounds.
struct LabelledTets {
    /// \param patches  triangles in the order of boundary_of(tets.tets), with patches or without
    /// \throws Error{InvalidInput} if a region is below 1, which gmsh and FreeFem don't allow, or
    /// there aren't as many patches as triangles
    LabelledTets(const TetMesh& tets, const SurfaceMesh& patches);

    [[nodiscard]] std::int32_t region_of(std::size_t tet) const {
        return mesh.region.empty() ? 1 : mesh.region[tet];
    }
    [[nodiscard]] std::int32_t label_of(std::size_t triangle) const {
        return surface.patch.empty() ? region_of(static_cast<std::size_t>(owner[triangle]))
                                     : surface.patch[triangle] + 1;
    }
    /// "boundary_r" or the name of the patch, which may hold anything but blanks and quotes.
    [[nodiscard]] std::string name_of(std::int32_t label) const;
    /// Labels of the triangles that bound a region, in order.
    [[nodiscard]] std::vector<std::int32_t> labels_around(std::int32_t region) const;

    const TetMesh& mesh;
    const SurfaceMesh& surface;
    std::vector<Index> owner{};           ///< Tet of each boundary triangle.
    std::vector<Triangle> boundary{};     ///< Facing outward.
    std::vector<std::int32_t> regions{};  ///< All that occur, in order.
    std::vector<std::int32_t> labels{};   ///< Of triangles, all that occur, in order.
};

}  // namespace remesh::io
