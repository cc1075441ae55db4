#include "core/geometry/wide_tree.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <utility>

namespace remesh {
namespace {

constexpr int kBins = 16;
constexpr std::int32_t kMedianBelow = 64;   // Few triangles: full leaves matter more than areas.
constexpr int kMaxSahDepth = 48;            // Beyond it only halves, so that the depth is bounded.
constexpr std::int32_t kSideBySide = 8192;  // Parts of more triangles are built side by side.
constexpr float kPad = 2.5e-7F;             // More than the rounding of a float in [-1, 1].

struct BoxF {
    Eigen::Array3f low = Eigen::Array3f::Constant(std::numeric_limits<float>::infinity());
    Eigen::Array3f high = Eigen::Array3f::Constant(-std::numeric_limits<float>::infinity());

    void include(const BoxF& other) {
        low = low.min(other.low);
        high = high.max(other.high);
    }
    void include(const Eigen::Array3f& point) {
        low = low.min(point);
        high = high.max(point);
    }
    [[nodiscard]] float half_area() const {
        const Eigen::Array3f d = high - low;
        return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    }
};

struct Item {
    BoxF box;
    Index triangle;

    [[nodiscard]] Eigen::Array3f middle() const { return 0.5F * (box.low + box.high); }
};

struct Range {
    std::int32_t begin;
    std::int32_t end;

    [[nodiscard]] std::int32_t size() const { return end - begin; }
};

// Adds a tree whose root hangs below a node of `to`. Returns what points to it.
std::int32_t append(WideTree& to, const WideTree& tree) {
    const auto node = static_cast<std::int32_t>(to.nodes.size());
    const auto leaf = static_cast<std::int32_t>(to.leaf_begin.size());
    const auto first = static_cast<std::int32_t>(to.order.size());
    for (WideTree::Node copy : tree.nodes) {
        for (std::int32_t& child : copy.child) {
            if (child != WideTree::kEmpty) {
                child = child >= 0 ? child + node : ~(~child + leaf);
            }
        }
        to.nodes.push_back(copy);
    }
    for (const std::int32_t begin : tree.leaf_begin) {
        to.leaf_begin.push_back(begin + first);
    }
    to.order.insert(to.order.end(), tree.order.begin(), tree.order.end());
    return tree.nodes.empty() ? ~leaf : node;
}

class Builder {
public:
    Builder(std::vector<Item> items, std::int32_t leaf_size)
        : items_(std::move(items)), leaf_size_(leaf_size) {}

    void build(WideTree& tree) {
        const auto n = static_cast<std::int32_t>(items_.size());
        tree.nodes.reserve(items_.size() / 8 + 1);
        tree.leaf_begin.reserve(items_.size() / 3 + 2);
        tree.order.reserve(items_.size());
        add_node(tree, {0, n}, 0);
        tree.leaf_begin.push_back(n);
    }

private:
    std::int32_t add(WideTree& tree, Range range, int depth) {
        if (range.size() > leaf_size_) {
            return add_node(tree, range, depth);
        }
        const auto leaf = static_cast<std::int32_t>(tree.leaf_begin.size());
        tree.leaf_begin.push_back(static_cast<std::int32_t>(tree.order.size()));
        for (std::int32_t i = range.begin; i != range.end; ++i) {
            tree.order.push_back(items_[static_cast<std::size_t>(i)].triangle);
        }
        return ~leaf;
    }

    std::int32_t add_node(WideTree& tree, Range range, int depth) {
        std::array<Range, 4> parts{};
        std::size_t count = 0;
        if (range.size() <= leaf_size_) {
            parts[count++] = range;
        } else {
            const std::int32_t middle = split(range, depth);
            for (const Range half : {Range{range.begin, middle}, Range{middle, range.end}}) {
                if (half.size() <= leaf_size_) {
                    parts[count++] = half;
                } else {
                    const std::int32_t quarter = split(half, depth + 1);
                    parts[count++] = {half.begin, quarter};
                    parts[count++] = {quarter, half.end};
                }
            }
        }
        const std::size_t index = tree.nodes.size();
        tree.nodes.emplace_back();
        std::array<std::int32_t, 4> child{WideTree::kEmpty, WideTree::kEmpty, WideTree::kEmpty,
                                          WideTree::kEmpty};
        if (range.size() > kSideBySide) {
            std::array<WideTree, 4> subtrees;
            tbb::parallel_for(std::size_t{0}, count,
                              [&](std::size_t k) { add(subtrees[k], parts[k], depth + 2); });
            for (std::size_t k = 0; k < count; ++k) {
                child[k] = append(tree, subtrees[k]);
                subtrees[k] = {};
            }
        } else {
            for (std::size_t k = 0; k < count; ++k) {
                child[k] = add(tree, parts[k], depth + 2);
            }
        }
        auto& node = tree.nodes[index];
        for (std::size_t k = 0; k < 4; ++k) {
            const BoxF box = k < count ? box_of(parts[k]) : BoxF{};
            const auto lane = static_cast<Eigen::Index>(k);
            for (std::size_t d = 0; d < 3; ++d) {
                node.low[d][lane] = box.low[static_cast<Eigen::Index>(d)];
                node.high[d][lane] = box.high[static_cast<Eigen::Index>(d)];
            }
            node.child[k] = child[k];
        }
        return static_cast<std::int32_t>(index);
    }

    [[nodiscard]] BoxF box_of(Range range) const {
        BoxF box;
        for (std::int32_t i = range.begin; i != range.end; ++i) {
            box.include(items_[static_cast<std::size_t>(i)].box);
        }
        return box;
    }

    std::int32_t split(Range range, int depth) {
        BoxF middles;
        for (std::int32_t i = range.begin; i != range.end; ++i) {
            middles.include(items_[static_cast<std::size_t>(i)].middle());
        }
        Eigen::Index axis = 0;
        const float extent = (middles.high - middles.low).maxCoeff(&axis);
        if (range.size() > kMedianBelow && depth < kMaxSahDepth && extent > 0.0F) {
            const auto cut = split_by_area(range, axis, middles.low[axis], extent);
            if (cut != range.begin && cut != range.end) {
                return cut;
            }
        }
        return split_at_median(range, axis);
    }

    std::int32_t split_at_median(Range range, Eigen::Index axis) {
        const std::int32_t leaves = (range.size() + leaf_size_ - 1) / leaf_size_;
        const std::int32_t middle = range.begin + (leaves / 2) * leaf_size_;
        const auto first = items_.begin();
        std::nth_element(first + range.begin, first + middle, first + range.end,
                         [axis](const Item& a, const Item& b) {
                             const float x = a.box.low[axis] + a.box.high[axis];
                             const float y = b.box.low[axis] + b.box.high[axis];
                             return x != y ? x < y : a.triangle < b.triangle;
                         });
        return middle;
    }

    std::int32_t split_by_area(Range range, Eigen::Index axis, float from, float extent) {
        const float to_bin = static_cast<float>(kBins) * (1.0F - 1e-6F) / extent;
        const auto bin_of = [&](const Item& item) {
            const int bin = static_cast<int>((item.middle()[axis] - from) * to_bin);
            return static_cast<std::size_t>(std::clamp(bin, 0, kBins - 1));
        };
        std::array<BoxF, kBins> boxes;
        std::array<int, kBins> counts{};
        for (std::int32_t i = range.begin; i != range.end; ++i) {
            const Item& item = items_[static_cast<std::size_t>(i)];
            const std::size_t bin = bin_of(item);
            boxes[bin].include(item.box);
            ++counts[bin];
        }
        const std::size_t best = cheapest_cut(boxes, counts);
        const auto first = items_.begin();
        const auto cut = std::partition(first + range.begin, first + range.end,
                                        [&](const Item& item) { return bin_of(item) < best; });
        return static_cast<std::int32_t>(cut - first);
    }

    static std::size_t cheapest_cut(const std::array<BoxF, kBins>& boxes,
                                    const std::array<int, kBins>& counts) {
        std::array<float, kBins> right_cost{};
        BoxF box;
        int count = 0;
        for (std::size_t i = kBins - 1; i > 0; --i) {
            box.include(boxes[i]);
            count += counts[i];
            right_cost[i] = count > 0 ? static_cast<float>(count) * box.half_area() : 0.0F;
        }
        box = {};
        count = 0;
        std::size_t best = 0;
        float best_cost = std::numeric_limits<float>::infinity();
        for (std::size_t i = 1; i < kBins; ++i) {
            box.include(boxes[i - 1]);
            count += counts[i - 1];
            const float cost =
                right_cost[i] + (count > 0 ? static_cast<float>(count) * box.half_area() : 0.0F);
            if (cost < best_cost) {
                best_cost = cost;
                best = i;
            }
        }
        return best;
    }

    std::vector<Item> items_;
    std::int32_t leaf_size_;
};

}  // namespace

WideTree build_wide_tree(const Points& vertices, const std::vector<Triangle>& triangles,
                         int leaf_size) {
    WideTree tree;
    if (triangles.empty()) {
        tree.leaf_begin.push_back(0);
        return tree;
    }
    Box bounds;
    for (const auto& triangle : triangles) {
        for (const Index v : triangle) {
            bounds.include(vertices[static_cast<std::size_t>(v)]);
        }
    }
    tree.center = 0.5 * (bounds.low + bounds.high);
    const double size = 0.5 * (bounds.high - bounds.low).maxCoeff();
    tree.scale = size > 0.0 ? 1.0 / size : 1.0;

    std::vector<Item> items(triangles.size());
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        items[i].triangle = static_cast<Index>(i);
        for (const Index v : triangles[i]) {
            items[i].box.include(tree.to_tree(vertices[static_cast<std::size_t>(v)]).array());
        }
        items[i].box.low -= kPad;
        items[i].box.high += kPad;
    }
    Builder(std::move(items), leaf_size).build(tree);
    return tree;
}

}  // namespace remesh
