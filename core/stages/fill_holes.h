#pragma once

#include <cstdint>
#include <optional>

#include "core/geometry/winding_number.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

struct FillOptions {
    double h = 0.0;         ///< Wanted edge length, model units, > 0.
    bool is_rough = false;  ///< Whether the surface's own points are noisy.
};

struct FillResult {
    SurfaceMesh patches{};          ///< Facing outward.
    std::int64_t filled = 0;        ///< Holes, and gaps between two ends of a tube.
    double area = 0.0;              ///< Of the patches.
    std::optional<Vec3> largest{};  ///< Middle of the hole with the longest rim.
};

/// Fills holes wider than about 3 h, and rings missing from tubes, so that the surface around goes
/// on smoothly: by the least bent surface through what lies around them. The level 1/2 of the
/// winding number would sag there, as a soap film does.
///
/// Ends of tubes that face no other end aren't holes, nor are seams that merely don't join.
///
/// \param surface  oriented
/// \param winding  of it
FillResult fill_wide_holes(const SurfaceMesh& surface, const WindingNumber& winding,
                           const FillOptions& options, RunContext& run);

}  // namespace remesh
