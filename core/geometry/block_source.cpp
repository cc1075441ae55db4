#include "core/geometry/block_source.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "core/mesh/index.h"

namespace remesh {
namespace {

constexpr Index kLeafSize = 8;
constexpr std::size_t kMaxDepth = 64;  // Halving 2^31 blocks takes 28.

}  // namespace

BlockSource::BlockSource(std::vector<SizingBlock> blocks, const Eigen::Matrix3d& axes,
                         const Vec3& origin, double gradation)
    : blocks_(std::move(blocks)),
      to_local_(axes.transpose()),
      origin_(origin),
      gradation_(gradation) {
    if (!blocks_.empty()) {
        build(0, static_cast<Index>(blocks_.size()));
    }
}

double BlockSource::least() const {
    return nodes_.empty() ? std::numeric_limits<double>::infinity()
                          : static_cast<double>(nodes_[0].bound.h);
}

double BlockSource::least_within(const Vec3& center, double radius, double best) const {
    struct Visit {
        Index node;
        double bound;
    };
    if (nodes_.empty()) {
        return best;
    }
    const Vec3 local = to_local_ * (center - origin_);
    std::array<Visit, kMaxDepth> stack{};
    std::size_t depth = 0;
    stack[depth++] = {0, bound(nodes_[0].bound, local, radius)};
    while (depth > 0) {
        const Visit visit = stack[--depth];
        if (visit.bound >= best) {
            continue;
        }
        const Node& node = nodes_[at(visit.node)];
        if (node.right == kNone) {
            for (Index i = node.first; i < node.first + node.count; ++i) {
                best = std::min(best, bound(blocks_[at(i)], local, radius));
            }
            continue;
        }
        Visit near{visit.node + 1, bound(nodes_[at(visit.node + 1)].bound, local, radius)};
        Visit far{node.right, bound(nodes_[at(node.right)].bound, local, radius)};
        if (far.bound < near.bound) {
            std::swap(near, far);
        }
        stack[depth++] = far;
        stack[depth++] = near;
    }
    return best;
}

Index BlockSource::build(Index first, Index count) {
    const auto id = static_cast<Index>(nodes_.size());
    nodes_.emplace_back();
    Node node{.bound = blocks_[at(first)], .first = first, .count = count};
    for (Index i = first + 1; i < first + count; ++i) {
        const SizingBlock& block = blocks_[at(i)];
        node.bound.low = node.bound.low.cwiseMin(block.low);
        node.bound.high = node.bound.high.cwiseMax(block.high);
        node.bound.h = std::min(node.bound.h, block.h);
    }
    if (count > kLeafSize) {
        Eigen::Index axis = 0;
        (node.bound.high - node.bound.low).maxCoeff(&axis);
        const Index half = count / 2;
        const auto begin = blocks_.begin() + first;
        std::nth_element(begin, begin + half, begin + count,
                         [axis](const SizingBlock& a, const SizingBlock& b) {
                             return a.low[axis] + a.high[axis] < b.low[axis] + b.high[axis];
                         });
        build(first, half);
        node.right = build(first + half, count - half);
    }
    nodes_[at(id)] = node;
    return id;
}

double BlockSource::bound(const SizingBlock& block, const Vec3& local, double radius) const {
    const Vec3 outside = (block.low.cast<double>() - local)
                             .cwiseMax(local - block.high.cast<double>())
                             .cwiseMax(Vec3::Zero());
    return static_cast<double>(block.h) + gradation_ * std::max(0.0, outside.norm() - radius);
}

}  // namespace remesh
