#pragma once

#include <cstddef>

#include "core/exact/delaunay.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// The same tets as delaunay_cells, made in slabs across the points' longest extent, which run on
/// all threads.
///
/// Each slab triangulates its points and a few layers beyond. Its tets whose circumspheres don't
/// reach beyond those are Delaunay tets of all points, since no other point can be inside. What no
/// slab can vouch for (tets of large spheres, outside of bodies and in their concavities) is the
/// Delaunay triangulation of the vertices it has, filled in from the faces that are left open.
/// That the set of tets is unique, by the symbolic perturbation, is what makes it fit.
///
/// \param points  #P positions, all finite
/// \throws Error{Cancelled}
TetComplex delaunay_in_slabs(const Points& points, std::size_t slabs, const RunContext& run);

/// How many slabs pay for so many points on the threads of the present arena; 1 or more.
[[nodiscard]] std::size_t worthwhile_slabs(std::size_t points);

}  // namespace remesh
