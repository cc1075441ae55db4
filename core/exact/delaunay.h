#pragma once

#include <array>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// Tets with the neighbour across each face.
struct TetComplex {
    std::vector<Tet> tets{};  ///< #T, positively oriented.
    std::vector<std::array<Index, 4>>
        neighbours{};  ///< #T. Tet across the face opposite of each corner; kNone on the hull.
};

/// Finite cells of CGAL's Delaunay triangulation, in no particular order; none if the points span
/// no volume. Of points that coincide, only the one with the lowest index is in any tet.
///
/// Cospherical points are perturbed symbolically, so that the set of tets is unique.
/// \param points  #P positions, all finite
TetComplex delaunay_cells(const Points& points);

}  // namespace remesh
