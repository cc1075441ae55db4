#pragma once

#include "core/exact/delaunay.h"
#include "core/geometry/lattice.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// Those Delaunay tets of all points that can be read off the lattice which most of them still are
/// sites of, with kNone across all other faces.
///
/// A tet of the ideal lattice whose four sites are taken is one of all points unless a point that
/// is no site has come into its sphere: other sites keep 0.14 cells away from it, and points are
/// taken for sites only within 0.003 cells.
///
/// \param points  #P positions, all finite
/// \throws Error{Cancelled}
TetComplex lattice_cells(const Points& points, const Lattice& lattice, const RunContext& run);

}  // namespace remesh
