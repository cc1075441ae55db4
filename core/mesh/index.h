#pragma once

#include <cstddef>

#include "core/mesh/mesh.h"

namespace remesh {

/// Where vertex, triangle, tet or particle i stands in a vector.
[[nodiscard]] inline std::size_t at(Index i) {
    return static_cast<std::size_t>(i);
}

}  // namespace remesh
