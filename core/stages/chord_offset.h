#pragma once

#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// How far outward a smooth surface must lie so that triangles of edge length h, with their corners
/// on it, enclose the volume that the surface encloses now.
///
/// A triangle lies h^2 H / 8 on average below a surface of mean curvature H. Where the curvature is
/// that of a rod thinner than about 1.4 h, edges are taken to be shorter, as the thickness guard
/// makes them.
///
/// \param normals  #V unit, outward
/// \param h        wanted edge length, model units
/// \return         #V offsets along the normals, model units
std::vector<double> chord_offsets(const SurfaceMesh& surface, const Points& normals, double h);

}  // namespace remesh
