#pragma once

#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// Finite cells of CGAL's Delaunay triangulation, positively oriented, in no particular order.
/// Points that coincide with an earlier one are in no tet.
std::vector<Tet> delaunay_cells(const Points& points);

}  // namespace remesh
