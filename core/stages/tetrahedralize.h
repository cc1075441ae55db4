#pragma once

#include "core/exact/delaunay.h"
#include "core/geometry/lattice.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// Delaunay tetrahedra of the convex hull of points, in a canonical order: each tet starts with its
/// smallest vertex and goes on with the next smallest that keeps it positively oriented as a
/// rotation of the other three; tets are sorted. So the same for any number of threads.
///
/// A stop takes effect only after CGAL has finished (about a second per million tets).
/// \param points   #P positions; coincident ones are left out of all tets but the first's
/// \param lattice  of which many are sites, if any: only saves time
/// \throws Error{Unmeshable} if the points span no volume or one isn't finite; Error{Cancelled}
TetComplex tetrahedralize(const Points& points, RunContext& run, const Lattice& lattice = {});

}  // namespace remesh
