#pragma once

#include <string>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh::testing {

/// What keeps triangles from being a closed, consistently oriented 2-manifold, or "" if nothing
/// does. Slow and simple: walks around each vertex from triangle to triangle.
std::string manifold_fault(const std::vector<Triangle>& triangles);

}  // namespace remesh::testing
