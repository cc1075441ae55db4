#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

struct PinholeResult {
    std::vector<Triangle> triangles{};  ///< Between vertices of the surface, facing outward,
    std::vector<std::int32_t> patch{};  ///< of the patch at their rim; empty without patches.
    std::int64_t closed = 0;            ///< Holes.
    double area = 0.0;                  ///< Of the triangles.
    std::optional<Vec3> largest{};      ///< Middle of the hole with the longest rim.
    bool is_watertight = false;         ///< Whether every edge then has an even number of
                                        ///< triangles.
};

/// Spans holes narrower than about 3 h that have one plain rim of few edges, each by triangles of
/// least area between the rim's vertices.
///
/// Where single triangles are missing all over, each takes its solid angle away, everywhere: the
/// winding number sinks by the share that's missing, and its level 1/2 with it.
///
/// Ends of tubes aren't holes, nor is what is round a piece hardly larger than its hole.
///
/// \param surface  oriented
/// \param h        wanted edge length, model units, > 0
PinholeResult close_pinholes(const SurfaceMesh& surface, double h, RunContext& run);

}  // namespace remesh
