#pragma once

#include <utility>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// Pairs of triangles that meet anywhere but in a common vertex or edge, by exact predicates;
/// first < second, sorted. Triangles that share an edge count when they fold onto each other, and
/// touching counts. Vertices are the same only if their indices are: two of them at one position
/// make their triangles meet. Exactly collinear and non-finite triangles are left out.
std::vector<std::pair<Index, Index>> self_intersections(const Points& vertices,
                                                        const std::vector<Triangle>& triangles);

/// Sign of the volume of a tet, exact: 1 positively oriented, 0 flat, -1 inverted.
int orientation_sign(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

}  // namespace remesh
