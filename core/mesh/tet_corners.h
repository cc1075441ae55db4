#pragma once

#include <array>
#include <cstddef>

namespace remesh {

/// Corners of the face opposite of each corner of a tet, facing outward.
inline constexpr std::array<std::array<std::size_t, 3>, 4> kFaces{
    {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// Corners of the edges of a tet.
inline constexpr std::array<std::array<std::size_t, 2>, 6> kEdges{
    {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

/// Even permutations that bring corner i to the front.
inline constexpr std::array<std::array<std::size_t, 4>, 4> kToFront{
    {{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 3, 0, 1}, {3, 2, 1, 0}}};

}  // namespace remesh
