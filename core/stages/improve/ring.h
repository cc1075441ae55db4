#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "core/stages/improve/live_mesh.h"

namespace remesh::improve {

inline constexpr std::size_t kMaxRing = 8;

/// The tets around an edge (a, b), in order, and the vertices that they pass, counter-clockwise
/// seen from b.
struct Ring {
    std::array<Index, kMaxRing> tets{};
    std::array<Index, kMaxRing + 1> vertices{};
    std::size_t tet_count = 0;
    std::size_t size = 0;  ///< Of vertices; one more than tets where the edge is on the boundary.

    [[nodiscard]] bool is_open() const { return size == tet_count + 1; }
    [[nodiscard]] Index first() const { return vertices[0]; }
    [[nodiscard]] Index last() const { return vertices[size - 1]; }
};

/// Nothing if there is no such edge, if it has more than 8 vertices around it, or two fans of tets.
[[nodiscard]] std::optional<Ring> ring_around(const LiveMesh& mesh, Index a, Index b);

}  // namespace remesh::improve
