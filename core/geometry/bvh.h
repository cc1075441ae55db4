#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "core/geometry/wide_tree.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// Closest point of a triangle. Source: Ericson, Real-Time Collision Detection, section 5.1.5.
[[nodiscard]] Vec3 closest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

/// Closest point and first hit on a set of triangles. Keeps a copy of them, in the tree's order.
class Bvh {
public:
    struct Nearest {
        Vec3 point = Vec3::Zero();
        Index triangle = kNone;
        double distance2 = 0.0;  ///< Squared, model units.
    };
    struct Hit {
        double t = 0.0;  ///< Along the ray.
        Index triangle = kNone;
    };

    Bvh() = default;
    /// \param triangles  over finite `vertices`, indices in range
    Bvh(const Points& vertices, const std::vector<Triangle>& triangles);

    [[nodiscard]] bool empty() const { return corners_.empty(); }

    /// Closest point nearer than sqrt(`radius2`). O(log n); with a triangle near the answer as
    /// `hint` a few times faster. A tie goes to the hint, then to the first in the tree's order.
    [[nodiscard]] std::optional<Nearest> closest(const Vec3& point, double radius2,
                                                 Index hint = kNone) const;

    /// First triangle along a ray with t in (t_min, t_max) that `accept(t, triangle)` agrees to.
    ///
    /// \param direction  unit vector
    template <typename Accept>
    [[nodiscard]] std::optional<Hit> first_hit(const Vec3& origin, const Vec3& direction,
                                               double t_min, double t_max,
                                               const Accept& accept) const;

private:
    struct Corners {
        Vec3 a, b, c;
    };

    /// t of the ray's plane crossing if it lies within the triangle.
    [[nodiscard]] static std::optional<double> cross_ray(const Corners& triangle,
                                                         const Vec3& origin, const Vec3& direction);

    WideTree tree_;
    std::vector<Corners> corners_;  // By slot: the place in tree_.order.
    std::vector<Index> slot_of_;    // By triangle.
};

template <typename Accept>
std::optional<Bvh::Hit> Bvh::first_hit(const Vec3& origin, const Vec3& direction, double t_min,
                                       double t_max, const Accept& accept) const {
    std::optional<Hit> best;
    if (empty()) {
        return best;
    }
    const Eigen::Vector3f start = tree_.to_tree(origin);
    // A zero component becomes a tiny one: no 0 * inf, and the slabs still decide.
    Eigen::Array3f inverse;
    for (Eigen::Index d = 0; d < 3; ++d) {
        const double x = std::abs(direction[d]) < 1e-12 ? 1e-12 : direction[d];
        inverse[d] = static_cast<float>(1.0 / x);
    }
    const auto from = static_cast<float>(t_min * tree_.scale) - 1e-6F;
    std::array<std::int32_t, WideTree::kMaxStack> stack;
    std::size_t top = 0;
    stack[top++] = 0;
    double limit = t_max;
    while (top > 0) {
        const std::int32_t code = stack[--top];
        if (code < 0) {
            const auto leaf = static_cast<std::size_t>(~code);
            for (std::int32_t s = tree_.leaf_begin[leaf]; s != tree_.leaf_begin[leaf + 1]; ++s) {
                const auto slot = static_cast<std::size_t>(s);
                const auto t = cross_ray(corners_[slot], origin, direction);
                if (t && *t > t_min && *t < limit && accept(*t, tree_.order[slot])) {
                    limit = *t;
                    best = Hit{*t, tree_.order[slot]};
                }
            }
            continue;
        }
        const auto& node = tree_.nodes[static_cast<std::size_t>(code)];
        const float to = std::min(static_cast<float>(limit * tree_.scale) * 1.000001F + 1e-6F,
                                  std::numeric_limits<float>::max());
        Lanes near = Lanes::Constant(from);
        Lanes far = Lanes::Constant(to);
        for (std::size_t d = 0; d < 3; ++d) {
            const auto e = static_cast<Eigen::Index>(d);
            const Lanes x = (node.low[d] - start[e]) * inverse[e];
            const Lanes y = (node.high[d] - start[e]) * inverse[e];
            near = near.max(x.min(y));
            far = far.min(x.max(y));
        }
        for (std::size_t k = 0; k < 4; ++k) {
            const auto lane = static_cast<Eigen::Index>(k);
            if (node.child[k] != WideTree::kEmpty && near[lane] <= far[lane] + 1e-6F) {
                stack[top++] = node.child[k];
            }
        }
    }
    return best;
}

}  // namespace remesh
