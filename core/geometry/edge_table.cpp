#include "core/geometry/edge_table.h"

#include <algorithm>
#include <numeric>

namespace remesh {

EdgeTable::EdgeTable(const std::vector<Triangle>& triangles, std::size_t vertex_count) {
    const std::size_t n = 3 * triangles.size();
    const auto lower_end = [&](HalfEdge h) {
        return static_cast<std::size_t>(std::min(start_of(triangles, h), end_of(triangles, h)));
    };
    // Counting sort by the lower vertex, then a small sort inside each bucket.
    std::vector<std::int32_t> bucket(vertex_count + 1, 0);
    for (std::size_t h = 0; h < n; ++h) {
        ++bucket[lower_end(static_cast<HalfEdge>(h)) + 1];
    }
    std::partial_sum(bucket.begin(), bucket.end(), bucket.begin());
    half_edges_.resize(n);
    std::vector<std::int32_t> next(bucket.begin(), bucket.end() - 1);
    for (std::size_t h = 0; h < n; ++h) {
        auto& slot = next[lower_end(static_cast<HalfEdge>(h))];
        half_edges_[static_cast<std::size_t>(slot++)] = static_cast<HalfEdge>(h);
    }
    const auto higher_end = [&](HalfEdge h) {
        return std::max(start_of(triangles, h), end_of(triangles, h));
    };
    edge_of_.resize(n);
    edges_.reserve(n / 2 + 1);
    for (std::size_t v = 0; v < vertex_count; ++v) {
        const auto first = half_edges_.begin() + bucket[v];
        const auto last = half_edges_.begin() + bucket[v + 1];
        std::sort(first, last, [&](HalfEdge a, HalfEdge b) {
            const Index x = higher_end(a);
            const Index y = higher_end(b);
            return x != y ? x < y : a < b;
        });
        for (auto it = first; it != last; ++it) {
            const Index high = higher_end(*it);
            if (it == first || edges_.back().high != high) {
                edges_.push_back({static_cast<Index>(v), high,
                                  static_cast<std::int32_t>(it - half_edges_.begin()), 0});
            }
            ++edges_.back().count;
            edge_of_[static_cast<std::size_t>(*it)] = static_cast<std::int32_t>(edges_.size()) - 1;
        }
    }
}

DisjointSets::DisjointSets(std::size_t n) : parent_(n) {
    std::iota(parent_.begin(), parent_.end(), 0);
}

Index DisjointSets::find(Index i) {
    auto at = static_cast<std::size_t>(i);
    while (parent_[at] != static_cast<Index>(at)) {
        parent_[at] = parent_[static_cast<std::size_t>(parent_[at])];
        at = static_cast<std::size_t>(parent_[at]);
    }
    return static_cast<Index>(at);
}

void DisjointSets::merge(Index a, Index b) {
    const Index x = find(a);
    const Index y = find(b);
    parent_[static_cast<std::size_t>(std::max(x, y))] = std::min(x, y);
}

}  // namespace remesh
