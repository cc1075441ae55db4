#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/exact/delaunay.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

// From some cells of a Delaunay triangulation to all of them. That the set of all is unique, by the
// symbolic perturbation of delaunay_cells, is what makes pieces fit, however they were found.
namespace remesh {

/// A face of a tet: its vertices in ascending order, and whether outward they are an even
/// permutation of that.
struct CellFace {
    std::array<Index, 3> vertices{};
    bool is_even = false;
    std::int8_t corner = 0;  ///< Opposite.
    Index tet = kNone;
};

/// The cells of some points, by themselves.
using Triangulate = std::function<TetComplex(const Points&)>;

/// The same complex with other numbers for its vertices.
[[nodiscard]] TetComplex renumbered(TetComplex complex, const std::vector<Index>& vertices);

[[nodiscard]] Points selected(const Points& points, const std::vector<Index>& vertices);

/// Links the faces without a neighbour at which tets meet. Returns those that are still open, in
/// order.
std::vector<CellFace> sew(TetComplex& complex);

/// Adds all other Delaunay tets of the points. They have no vertices but those of open faces and
/// those in no tet yet, so they are among the Delaunay tets of these; and they are what lies beyond
/// the open faces.
///
/// \param complex  Delaunay tets of `points`, not all, with kNone across `open` faces only
/// \throws Error{Cancelled}
void complete(TetComplex& complex, const std::vector<CellFace>& open, const Points& points,
              const Triangulate& triangulate, const RunContext& run);

}  // namespace remesh
