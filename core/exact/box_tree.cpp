#include "core/exact/box_tree.h"

#include <tbb/parallel_sort.h>

namespace remesh {
namespace {

constexpr int kBits = 21;  // Of each coordinate, so that a code fits into 64 bits.

// The lowest 21 bits of x with two zeros between each.
std::uint64_t spread(std::uint64_t x) {
    x = (x | x << 32) & 0x001f00000000ffff;
    x = (x | x << 16) & 0x001f0000ff0000ff;
    x = (x | x << 8) & 0x100f00f00f00f00f;
    x = (x | x << 4) & 0x10c30c30c30c30c3;
    x = (x | x << 2) & 0x1249249249249249;
    return x;
}

// Place of a point along the Z-order curve through a box.
std::uint64_t curve_code(const Vec3& point, const Box& all) {
    std::uint64_t code = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double extent = all.high[axis] - all.low[axis];
        const double share = extent > 0.0 ? (point[axis] - all.low[axis]) / extent : 0.0;
        const auto cell = static_cast<std::uint64_t>(share * ((1 << kBits) - 1));
        code |= spread(cell) << axis;
    }
    return code;
}

}  // namespace

BoxTree::BoxTree(const std::vector<Box>& boxes) {
    Box all;
    for (const auto& box : boxes) {
        all.include(box.low);
        all.include(box.high);
    }
    std::vector<std::pair<std::uint64_t, Index>> sorted;
    sorted.reserve(boxes.size());
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Vec3 centre = 0.5 * boxes[i].low + 0.5 * boxes[i].high;
        sorted.emplace_back(curve_code(centre, all), static_cast<Index>(i));
    }
    tbb::parallel_sort(sorted.begin(), sorted.end());

    order_.reserve(boxes.size());
    boxes_.reserve(boxes.size());
    std::vector<Box> level((boxes.size() + kLeafSize - 1) / kLeafSize);
    for (const auto& [code, i] : sorted) {
        Box& leaf = level[order_.size() / kLeafSize];
        leaf.include(boxes[i].low);
        leaf.include(boxes[i].high);
        order_.push_back(i);
        boxes_.push_back(boxes[i]);
    }
    while (!level.empty()) {
        const bool is_root = level.size() == 1;
        std::vector<Box> above(is_root ? 0 : (level.size() + 1) / 2);
        for (std::size_t i = 0; i < level.size() && !is_root; ++i) {
            above[i / 2].include(level[i].low);
            above[i / 2].include(level[i].high);
        }
        levels_.push_back(std::move(level));
        level = std::move(above);
    }
}

}  // namespace remesh
