#include "core/geometry/sample_source.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "core/mesh/index.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr Index kLeafSize = 8;
constexpr std::size_t kMaxDepth = 64;  // Halving 2^31 samples takes 28.

}  // namespace

SampleSource::SampleSource(std::vector<SizingSample> samples, double gradation)
    : samples_(std::move(samples)), gradation_(gradation) {
    build();
    drop_void_samples();
}

double SampleSource::least() const {
    return nodes_.empty() ? std::numeric_limits<double>::infinity() : nodes_[0].least;
}

double SampleSource::least_within(const Vec3& center, double radius, double best) const {
    struct Visit {
        Index node;
        double bound;
    };
    std::array<Visit, kMaxDepth> stack;
    std::size_t depth = 0;
    if (!nodes_.empty()) {
        stack[depth++] = {0, bound(nodes_[0], center, radius)};
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
                const double around = sample.radius + radius;
                const double squared = (sample.x - center).squaredNorm();
                const double reach = (best - sample.h) / gradation_ + around;
                if (sample.h < best && reach > 0.0 && squared < reach * reach) {
                    best = std::min(
                        best, sample.h + gradation_ * std::max(0.0, std::sqrt(squared) - around));
                }
            }
            continue;
        }
        Visit near{visit.node + 1, bound(nodes_[at(visit.node + 1)], center, radius)};
        Visit far{node.right, bound(nodes_[at(node.right)], center, radius)};
        if (far.bound < near.bound) {
            std::swap(near, far);
        }
        if (far.bound < best) {
            stack[depth++] = far;
        }
        if (near.bound < best) {
            stack[depth++] = near;
        }
    }
    return best;
}

// Sample j makes sample i void if h_j + gradation max(0, |x_j - x_i| + radius_i - radius_j) < h_i,
// by the triangle inequality: which is what a query with radius -radius_i tells.
void SampleSource::drop_void_samples() {
    std::vector<char> is_void(samples_.size(), 0);
    const RunContext quiet;
    for_each_index(samples_.size(), quiet, [&](std::size_t i) {
        const SizingSample& sample = samples_[i];
        is_void[i] = least_within(sample.x, -sample.radius, sample.h) < sample.h ? 1 : 0;
    });
    std::vector<SizingSample> kept;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
        if (is_void[i] == 0) {
            kept.push_back(samples_[i]);
        }
    }
    if (kept.size() < samples_.size()) {
        samples_ = std::move(kept);
        build();
    }
}

void SampleSource::build() {
    nodes_.clear();
    if (!samples_.empty()) {
        build(0, static_cast<Index>(samples_.size()));
    }
}

Index SampleSource::build(Index first, Index count) {
    const auto id = static_cast<Index>(nodes_.size());
    nodes_.emplace_back();
    Node node{.least = std::numeric_limits<double>::infinity(), .first = first, .count = count};
    for (Index i = first; i < first + count; ++i) {
        node.box.include(samples_[at(i)].x);
        node.least = std::min(node.least, samples_[at(i)].h);
        node.radius = std::max(node.radius, samples_[at(i)].radius);
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

double SampleSource::bound(const Node& node, const Vec3& center, double radius) const {
    const Vec3 outside =
        (node.box.low - center).cwiseMax(center - node.box.high).cwiseMax(Vec3::Zero());
    return node.least + gradation_ * std::max(0.0, outside.norm() - node.radius - radius);
}

}  // namespace remesh
