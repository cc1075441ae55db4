#include "core/geometry/lipschitz_field.h"

#include <algorithm>
#include <array>
#include <utility>

namespace remesh {
namespace {

constexpr Index kLeafSize = 8;
constexpr std::size_t kMaxDepth = 64;  // Halving 2^31 samples takes 28.

std::size_t at(Index i) {
    return static_cast<std::size_t>(i);
}

}  // namespace

LipschitzField::LipschitzField(std::vector<SizingSample> samples, double h_max, double gradation,
                               double plateau)
    : samples_(std::move(samples)),
      h_min_(h_max),
      h_max_(h_max),
      gradation_(gradation),
      plateau_(plateau) {
    for (const SizingSample& sample : samples_) {
        h_min_ = std::min(h_min_, sample.h);
    }
    if (!samples_.empty()) {
        build(0, static_cast<Index>(samples_.size()));
    }
}

double LipschitzField::h(const Vec3& point) const {
    struct Visit {
        Index node;
        double bound;
    };
    std::array<Visit, kMaxDepth> stack;
    std::size_t depth = 0;
    double best = h_max_;
    if (!nodes_.empty()) {
        stack[depth++] = {0, bound(nodes_[0], point)};
    }
    while (depth > 0) {
        const Visit visit = stack[--depth];
        if (visit.bound >= best) {
            continue;
        }
        const Node& node = nodes_[at(visit.node)];
        if (node.right == kNone) {
            for (Index i = node.first; i < node.first + node.count; ++i) {
                const SizingSample& sample = samples_[at(i)];
                const double beyond = std::max(0.0, (sample.x - point).norm() - plateau_);
                best = std::min(best, sample.h + gradation_ * beyond);
            }
            continue;
        }
        Visit near{visit.node + 1, bound(nodes_[at(visit.node + 1)], point)};
        Visit far{node.right, bound(nodes_[at(node.right)], point)};
        if (far.bound < near.bound) {
            std::swap(near, far);
        }
        stack[depth++] = far;
        stack[depth++] = near;
    }
    return best;
}

Index LipschitzField::build(Index first, Index count) {
    const auto id = static_cast<Index>(nodes_.size());
    nodes_.emplace_back();
    Node node{.least = h_max_, .first = first, .count = count};
    for (Index i = first; i < first + count; ++i) {
        node.box.include(samples_[at(i)].x);
        node.least = std::min(node.least, samples_[at(i)].h);
    }
    if (count > kLeafSize) {
        Eigen::Index axis = 0;
        (node.box.high - node.box.low).maxCoeff(&axis);
        const Index half = count / 2;
        const auto begin = samples_.begin() + first;
        std::nth_element(
            begin, begin + half, begin + count,
            [axis](const SizingSample& a, const SizingSample& b) { return a.x[axis] < b.x[axis]; });
        build(first, half);
        node.right = build(first + half, count - half);
    }
    nodes_[at(id)] = node;
    return id;
}

double LipschitzField::bound(const Node& node, const Vec3& point) const {
    const Vec3 outside =
        (node.box.low - point).cwiseMax(point - node.box.high).cwiseMax(Vec3::Zero());
    return node.least + gradation_ * std::max(0.0, outside.norm() - plateau_);
}

}  // namespace remesh
