#include "core/geometry/bvh.h"

#include <algorithm>
#include <array>
#include <limits>

namespace remesh {
namespace {

constexpr int kLeafSize = 2;  // Four take a fifth longer to search.

}  // namespace

Vec3 closest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 ab = b - a;
    const Vec3 ac = c - a;
    const Vec3 ap = p - a;
    const double d1 = ab.dot(ap);
    const double d2 = ac.dot(ap);
    if (d1 <= 0.0 && d2 <= 0.0) {
        return a;
    }
    const Vec3 bp = p - b;
    const double d3 = ab.dot(bp);
    const double d4 = ac.dot(bp);
    if (d3 >= 0.0 && d4 <= d3) {
        return b;
    }
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
        return a + ab * (d1 / (d1 - d3));
    }
    const Vec3 cp = p - c;
    const double d5 = ab.dot(cp);
    const double d6 = ac.dot(cp);
    if (d6 >= 0.0 && d5 <= d6) {
        return c;
    }
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
        return a + ac * (d2 / (d2 - d6));
    }
    const double va = d3 * d6 - d5 * d4;
    const double u = d4 - d3;
    const double v = d5 - d6;
    if (va <= 0.0 && u >= 0.0 && v >= 0.0) {
        return b + (c - b) * (u / (u + v));
    }
    const double scale = 1.0 / (va + vb + vc);
    return a + ab * (vb * scale) + ac * (vc * scale);
}

Bvh::Bvh(const Points& vertices, const std::vector<Triangle>& triangles)
    : tree_(build_wide_tree(vertices, triangles, kLeafSize)) {
    corners_.resize(triangles.size());
    slot_of_.resize(triangles.size());
    for (std::size_t slot = 0; slot < corners_.size(); ++slot) {
        const auto triangle = static_cast<std::size_t>(tree_.order[slot]);
        const auto& t = triangles[triangle];
        corners_[slot] = {vertices[static_cast<std::size_t>(t[0])],
                          vertices[static_cast<std::size_t>(t[1])],
                          vertices[static_cast<std::size_t>(t[2])]};
        slot_of_[triangle] = static_cast<Index>(slot);
    }
}

std::optional<Bvh::Nearest> Bvh::closest(const Vec3& point, double radius2, Index hint) const {
    if (empty()) {
        return std::nullopt;
    }
    const double scale2 = tree_.scale * tree_.scale;
    Vec3 best_point = Vec3::Zero();
    std::int32_t best_slot = kNone;
    double best = radius2;
    float limit = 0.0F;
    // Slightly more than the true bound, since boxes and query are rounded to float.
    const auto set_limit = [&] {
        const double bound = best * scale2 * (1.0 + 4e-6) + 1e-13;
        limit = static_cast<float>(
            std::min(bound, static_cast<double>(std::numeric_limits<float>::max())));
    };
    const auto try_slot = [&](std::int32_t slot) {
        const auto& t = corners_[static_cast<std::size_t>(slot)];
        const Vec3 candidate = closest_on_triangle(point, t.a, t.b, t.c);
        const double distance2 = (candidate - point).squaredNorm();
        if (distance2 < best) {
            best = distance2;
            best_point = candidate;
            best_slot = slot;
            set_limit();
        }
    };
    set_limit();
    if (hint != kNone) {
        try_slot(slot_of_[static_cast<std::size_t>(hint)]);
    }

    struct Entry {
        std::int32_t code;
        float distance2;
    };
    const Eigen::Vector3f query = tree_.to_tree(point);
    std::array<Entry, WideTree::kMaxStack> stack;
    std::size_t top = 0;
    stack[top++] = {0, 0.0F};
    while (top > 0) {
        const Entry entry = stack[--top];
        if (entry.distance2 > limit) {
            continue;
        }
        if (entry.code < 0) {
            const auto leaf = static_cast<std::size_t>(~entry.code);
            for (std::int32_t s = tree_.leaf_begin[leaf]; s != tree_.leaf_begin[leaf + 1]; ++s) {
                try_slot(s);
            }
            continue;
        }
        const auto& node = tree_.nodes[static_cast<std::size_t>(entry.code)];
        Lanes distance2 = Lanes::Zero();
        for (std::size_t d = 0; d < 3; ++d) {
            const float q = query[static_cast<Eigen::Index>(d)];
            const Lanes gap = (node.low[d] - q).max(q - node.high[d]).max(0.0F);
            distance2 += gap * gap;
        }
        // Sorted insertion on top of the stack: the nearest child is looked at first.
        const std::size_t base = top;
        for (std::size_t k = 0; k < 4; ++k) {
            const float d2 = distance2[static_cast<Eigen::Index>(k)];
            if (node.child[k] == WideTree::kEmpty || d2 > limit) {
                continue;
            }
            std::size_t at = top++;
            while (at > base && stack[at - 1].distance2 < d2) {
                stack[at] = stack[at - 1];
                --at;
            }
            stack[at] = {node.child[k], d2};
        }
    }
    if (best_slot == kNone) {
        return std::nullopt;
    }
    return Nearest{best_point, tree_.order[static_cast<std::size_t>(best_slot)], best};
}

std::optional<double> Bvh::cross_ray(const Corners& triangle, const Vec3& origin,
                                     const Vec3& direction) {
    const Vec3 e1 = triangle.b - triangle.a;
    const Vec3 e2 = triangle.c - triangle.a;
    const Vec3 p = direction.cross(e2);
    const double determinant = e1.dot(p);
    if (determinant == 0.0) {
        return std::nullopt;
    }
    const double inverse = 1.0 / determinant;
    const Vec3 s = origin - triangle.a;
    const double u = s.dot(p) * inverse;
    if (u < 0.0 || u > 1.0) {
        return std::nullopt;
    }
    const Vec3 q = s.cross(e1);
    const double v = direction.dot(q) * inverse;
    if (v < 0.0 || u + v > 1.0) {
        return std::nullopt;
    }
    return e2.dot(q) * inverse;
}

}  // namespace remesh
