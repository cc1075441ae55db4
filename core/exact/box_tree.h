#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// Finds pairs of overlapping boxes. A binary tree without pointers over leaves of a few boxes,
/// which lie along a space-filling curve.
class BoxTree {
public:
    static constexpr std::size_t kLeafSize = 4;

    /// \param boxes  none of them empty or infinite
    explicit BoxTree(const std::vector<Box>& boxes);

    [[nodiscard]] std::size_t leaves() const { return levels_.empty() ? 0 : levels_[0].size(); }

    /// Calls `visit(a, b)`, a != b, for each pair of boxes that overlap or touch, with one of them
    /// in the given leaf and the other in this leaf or a later one: each pair once over all leaves.
    template <typename Visit>
    void overlaps_from(std::size_t leaf, const Visit& visit) const {
        descend(levels_.size() - 1, 0, leaf, visit);
    }

private:
    [[nodiscard]] static bool overlap(const Box& a, const Box& b) {
        return (a.low.array() <= b.high.array()).all() && (b.low.array() <= a.high.array()).all();
    }

    template <typename Visit>
    void descend(std::size_t level, std::size_t node, std::size_t leaf, const Visit& visit) const {
        const bool is_earlier = ((node + 1) << level) <= leaf;
        if (is_earlier || node >= levels_[level].size() ||
            !overlap(levels_[level][node], levels_[0][leaf])) {
            return;
        }
        if (level > 0) {
            descend(level - 1, 2 * node, leaf, visit);
            descend(level - 1, 2 * node + 1, leaf, visit);
        } else {
            compare_leaves(leaf, node, visit);
        }
    }

    template <typename Visit>
    void compare_leaves(std::size_t first, std::size_t second, const Visit& visit) const {
        for (std::size_t i = first * kLeafSize; i < end_of(first); ++i) {
            const std::size_t begin = first == second ? i + 1 : second * kLeafSize;
            for (std::size_t j = begin; j < end_of(second); ++j) {
                if (overlap(boxes_[i], boxes_[j])) {
                    visit(order_[i], order_[j]);
                }
            }
        }
    }

    [[nodiscard]] std::size_t end_of(std::size_t leaf) const {
        const std::size_t end = (leaf + 1) * kLeafSize;
        return end < boxes_.size() ? end : boxes_.size();
    }

    std::vector<Index> order_;              // Of the boxes along the curve.
    std::vector<Box> boxes_;                // In this order.
    std::vector<std::vector<Box>> levels_;  // Boxes of the leaves, of pairs of leaves, and so on.
};

}  // namespace remesh
