#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// Four floats that are computed on at once.
using Lanes = Eigen::Array4f;

/// A tree over triangles with up to four children a node and some triangles a leaf.
///
/// Boxes are floats relative to the middle of the model, scaled to about [-1, 1] and padded by more
/// than their rounding, so four of them are tested at once. What is exact is left to the leaves.
struct WideTree {
    static constexpr std::int32_t kEmpty = std::numeric_limits<std::int32_t>::max();
    static constexpr std::size_t kMaxStack = 192;  ///< Entries a depth-first walk may need.

    struct Node {
        std::array<Lanes, 3> low;
        std::array<Lanes, 3> high;
        std::array<std::int32_t, 4> child;  ///< >= 0: node; < 0: leaf ~child; kEmpty: none.
    };

    Vec3 center = Vec3::Zero();
    double scale = 1.0;                      ///< Tree units per model unit.
    std::vector<Node> nodes{};               ///< Root first; empty if there are no triangles.
    std::vector<std::int32_t> leaf_begin{};  ///< #leaves + 1 offsets into `order`.
    std::vector<Index> order{};              ///< #T triangle indices, leaf by leaf.

    [[nodiscard]] Eigen::Vector3f to_tree(const Vec3& point) const {
        return ((point - center) * scale).cast<float>();
    }
};

/// Builds the tree: surface area heuristic over 16 bins, medians for small sets. O(n log n).
///
/// \param triangles  over finite `vertices`, indices in range
/// \param leaf_size  most triangles of a leaf, >= 1
[[nodiscard]] WideTree build_wide_tree(const Points& vertices,
                                       const std::vector<Triangle>& triangles, int leaf_size = 4);

}  // namespace remesh
