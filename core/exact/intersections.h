#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// Bounds of a search, for surfaces that nobody has looked at yet.
struct CrossingLimits {
    bool only_apart = false;  ///< Leaves out pairs with a common vertex: far cheaper.
    std::size_t pairs = std::numeric_limits<std::size_t>::max();
    std::size_t candidates = std::numeric_limits<std::size_t>::max();  ///< Pairs of boxes.
};

struct Crossings {
    std::vector<std::pair<Index, Index>> pairs{};  ///< All, or any that were found before the end.
    bool is_complete = true;                       ///< Whether the limits were kept.
};

/// Pairs of triangles that meet anywhere but in a common vertex or edge, by exact predicates;
/// first < second, sorted. Triangles that share an edge count when they fold onto each other, and
/// touching counts. Vertices are the same only if their indices are: two of them at one position
/// make their triangles meet. Exactly collinear and non-finite triangles are left out.
/// \param checkpoint  called now and then, from any thread; may throw to stop
Crossings find_crossings(const Points& vertices, const std::vector<Triangle>& triangles,
                         const CrossingLimits& limits, const std::function<void()>& checkpoint);

/// All such pairs.
std::vector<std::pair<Index, Index>> self_intersections(
    const Points& vertices, const std::vector<Triangle>& triangles,
    const std::function<void()>& checkpoint = [] {});

/// Sign of the volume of a tet, exact: 1 positively oriented, 0 flat, -1 inverted.
int orientation_sign(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

}  // namespace remesh
