#pragma once

#include <cstddef>

#include "core/mesh/mesh.h"

namespace remesh {

/// A coarser copy of a surface for a person to look at, by edge collapse with quadric error
/// (Garland and Heckbert 1997, OpenMesh's decimater). Returned unchanged if small enough already;
/// a surface that isn't manifold is thinned as far as OpenMesh can hold it.
[[nodiscard]] SurfaceMesh decimate(const SurfaceMesh& surface, std::size_t max_triangles = 20'000);

}  // namespace remesh
