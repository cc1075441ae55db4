#pragma once

#include <vector>

#include "core/geometry/edge_table.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// An edge that only one triangle has.
struct RimEdge {
    Vec3 middle = Vec3::Zero();
    Vec3 outward = Vec3::Zero();  ///< Unit, in the triangle's plane, away from it.
    double length = 0.0;          ///< Model units.
};

[[nodiscard]] RimEdge rim_edge(const SurfaceMesh& surface, EdgeTable::HalfEdge half);

/// Connected edges that only one triangle has, and where the surface was about to go on there.
struct Rim {
    std::vector<EdgeTable::HalfEdge> edges{};  ///< In the order of the edge table.
    double length = 0.0;                       ///< Model units.
    Vec3 center = Vec3::Zero();
    double radius = 0.0;          ///< Mean distance from the center, model units.
    double far_radius = 0.0;      ///< Largest.
    Vec3 outward = Vec3::Zero();  ///< Mean direction: 1 long at the end of a tube, 0 at a hole.
    double convergence = 0.0;     ///< Mean share toward the center: 1 at a hole in a plane, -1
                                  ///< around a disc, 0 at the end of a tube.

    [[nodiscard]] bool is_hole() const { return convergence > 0.1 && outward.norm() < 0.5; }
    [[nodiscard]] bool is_tube_end() const { return outward.norm() > 0.7; }
};

/// A rim of the edges given, measured.
[[nodiscard]] Rim rim_of(const SurfaceMesh& surface, std::vector<EdgeTable::HalfEdge> edges);

/// The rims of an oriented surface, by their first edge in the table.
std::vector<Rim> find_rims(const SurfaceMesh& surface, const EdgeTable& table);

}  // namespace remesh
