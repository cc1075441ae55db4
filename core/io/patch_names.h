#pragma once

#include <cstddef>
#include <string>

#include "core/mesh/mesh.h"

namespace remesh::io {

/// Name of a patch, or its number if it has none; blanks and control characters as '_', since
/// most formats end a name there.
[[nodiscard]] std::string patch_name(const SurfaceMesh& surface, std::int32_t patch);

/// How many patches have a number, used or not: one more than the largest.
[[nodiscard]] std::int32_t patch_count(const SurfaceMesh& surface);

}  // namespace remesh::io
