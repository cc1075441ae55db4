#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// What is wrong with a mesh; all zero and empty for a valid one.
struct Faults {
    std::int64_t open_edges = 0;             ///< Boundary edges with one triangle.
    std::int64_t non_manifold_edges = 0;     ///< With more than two.
    std::int64_t non_manifold_vertices = 0;  ///< Whose triangles are not one fan.
    std::int64_t inconsistent_edges = 0;     ///< Of two triangles that run through them alike.
    std::int64_t inverted_tets = 0;  ///< Not positively oriented (exact predicate), or flat: 6 V at
                                     ///< most 1e-12 of the longest edge cubed.
    std::int64_t degenerate_triangles =
        0;  ///< A vertex twice, or height at most 1e-9 of the longest edge.
    std::int64_t overlapping_tets = 0;  ///< Faces with three tets or more, or two on one side.
    std::vector<std::pair<Index, Index>>
        intersections{};  ///< Pairs of triangles that meet outside a common vertex or edge; exact.
    std::vector<Index> fault_vertices{};  ///< Vertices of all of the above, sorted, no duplicates.

    [[nodiscard]] bool any() const;
    [[nodiscard]] std::string summary() const;  ///< "3 self-intersections, 1 non-manifold edge".
};

/// Checks a closed surface: manifold, consistently oriented, free of self-intersections. Exact.
///
/// A triangle that names a vertex twice has no edges and takes part in no other check.
/// \param surface  indices in range, patches ignored
/// \throws Error{Cancelled}
[[nodiscard]] Faults check_surface(const SurfaceMesh& surface, const RunContext& run);

/// Checks tets and their boundary. `fault_vertices` are indices of the tet mesh's vertices,
/// `intersections` of the triangles of `boundary_of(mesh.tets)`.
/// \param mesh  indices in range, regions ignored
/// \param boundary  becomes boundary_of(mesh.tets), if given
/// \throws Error{Cancelled}
[[nodiscard]] Faults check_tets(const TetMesh& mesh, const RunContext& run,
                                std::vector<Triangle>* boundary = nullptr);

}  // namespace remesh
