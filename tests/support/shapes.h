#pragma once

#include <functional>

#include "core/mesh/mesh.h"

namespace remesh::testing {

/// The cube [0, 1]^3 with 12 outward triangles.
SurfaceMesh unit_cube();

/// The unit sphere from an icosahedron refined `levels` times: 20 * 4^levels triangles.
SurfaceMesh icosphere(int levels);

/// A torus around z with radii `major` and `minor`; `around` by `across` quads, split.
SurfaceMesh torus(double major, double minor, int around, int across);

/// An L of three unit cubes in the plane z in [0, 1]: sharp edges, one of them concave. Volume 3.
SurfaceMesh l_shape();

/// Where `value` < 0, by marching tetrahedra on cells of the given size: closed inside the box.
SurfaceMesh level_set(const std::function<double(const Vec3&)>& value, const Box& box, double cell);

/// Every voxel face between inside and outside as two triangles: a staircase.
SurfaceMesh voxel_surface(const std::function<bool(const Vec3&)>& inside, const Box& box,
                          double cell);

/// Copies with some damage; positions are random but seeded.
SurfaceMesh with_triangles_removed(SurfaceMesh surface, double fraction, unsigned seed);
SurfaceMesh with_triangles_flipped(SurfaceMesh surface, double fraction, unsigned seed);
SurfaceMesh with_noise(SurfaceMesh surface, double sigma, unsigned seed);
SurfaceMesh as_soup(const SurfaceMesh& surface);  ///< No shared vertices.

/// Two surfaces side by side in one mesh.
SurfaceMesh join(SurfaceMesh a, const SurfaceMesh& b);
SurfaceMesh transformed(SurfaceMesh surface, const Eigen::Matrix3d& linear, const Vec3& shift);

}  // namespace remesh::testing
