#pragma once

#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// Delaunay tetrahedra of the convex hull of points, positively oriented, in a canonical order
/// (each tet starts with its smallest vertex; tets sorted), so the same for any number of threads.
///
/// A stop takes effect only after CGAL has finished (about a second per million tets).
/// \param points  #P positions; coincident ones are left out of all tets but the first's
/// \throws Error{Unmeshable} if the points span no volume; Error{Cancelled}
std::vector<Tet> tetrahedralize(const Points& points, RunContext& run);

}  // namespace remesh
