#pragma once

#include <cstddef>

#include "core/mesh/mesh.h"

namespace remesh {

/// A coarser copy of a surface for a person to look at, by edge collapse with quadric error
/// (Garland and Heckbert 1997, OpenMesh's decimater). Returned unchanged if small enough already;
/// a surface that isn't manifold is thinned as far as OpenMesh can hold it.
[[nodiscard]] SurfaceMesh decimate(const SurfaceMesh& surface, std::size_t max_triangles = 20'000);

/// A rougher copy for a glance while a run goes on, at about a hundredth of decimate's cost: the
/// vertices of each cell of a grid become one (Rossignac and Borrel 1993). Returned unchanged if
/// small enough already; thin parts may merge.
[[nodiscard]] SurfaceMesh cluster(const SurfaceMesh& surface, std::size_t max_triangles = 20'000);

}  // namespace remesh
