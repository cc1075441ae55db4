#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// The edges of a set of triangles, each with its half-edges. Sorted by the edge's lower and then
/// higher vertex; an edge's half-edges by triangle.
class EdgeTable {
public:
    /// Half-edge 3 t + k runs from corner k of triangle t to the next one.
    using HalfEdge = std::int32_t;

    struct Edge {
        Index low = kNone;   ///< Vertex with the lower index.
        Index high = kNone;  ///< Vertex with the higher index.
        std::int32_t first = 0;
        std::int32_t count = 0;  ///< Triangles at the edge.
    };

    explicit EdgeTable(const std::vector<Triangle>& triangles, std::size_t vertex_count);

    [[nodiscard]] const std::vector<Edge>& edges() const { return edges_; }
    [[nodiscard]] std::span<const HalfEdge> half_edges(const Edge& edge) const {
        return std::span(half_edges_)
            .subspan(static_cast<std::size_t>(edge.first), static_cast<std::size_t>(edge.count));
    }
    /// Edge of a half-edge, by its number.
    [[nodiscard]] const Edge& edge_of(HalfEdge half_edge) const {
        return edges_[static_cast<std::size_t>(edge_of_[static_cast<std::size_t>(half_edge)])];
    }

    [[nodiscard]] static std::size_t triangle_of(HalfEdge h) {
        return static_cast<std::size_t>(h) / 3;
    }
    [[nodiscard]] static std::size_t corner_of(HalfEdge h) {
        return static_cast<std::size_t>(h) % 3;
    }

private:
    std::vector<Edge> edges_;
    std::vector<HalfEdge> half_edges_;
    std::vector<std::int32_t> edge_of_;
};

/// Vertex where a half-edge starts, and where it ends.
[[nodiscard]] inline Index start_of(const std::vector<Triangle>& triangles, EdgeTable::HalfEdge h) {
    return triangles[EdgeTable::triangle_of(h)][EdgeTable::corner_of(h)];
}
[[nodiscard]] inline Index end_of(const std::vector<Triangle>& triangles, EdgeTable::HalfEdge h) {
    return triangles[EdgeTable::triangle_of(h)][(EdgeTable::corner_of(h) + 1) % 3];
}

/// Sets of indices that are merged pair by pair; a set's name is its lowest member.
class DisjointSets {
public:
    explicit DisjointSets(std::size_t n);

    [[nodiscard]] Index find(Index i);
    void merge(Index a, Index b);

private:
    std::vector<Index> parent_;
};

}  // namespace remesh
