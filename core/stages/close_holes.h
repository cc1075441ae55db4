#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/geometry/winding_number.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// Name of the patch of what closes holes, where the input has patches.
inline constexpr std::string_view kClosedHoles = "closed holes";

struct HoleOptions {
    double cell = 0.0;  ///< Size of the grid's cells, model units, > 0.
    double gap = 0.0;   ///< Triangles nearer than this to the skin aren't needed, model units.
};

struct HoleResult {
    SurfaceMesh patches{};          ///< Facing outward.
    double area = 0.0;              ///< Of the patches.
    std::optional<Vec3> largest{};  ///< Middle of the largest connected patch.
    double cell = 0.0;              ///< Size that was used: coarser if the cells would be too many.
};

/// Triangulates the level w = 1/2 of the winding number where the skin is open.
///
/// Marches over tets of a sparse grid, grown from the seeds along the level as long as it isn't
/// already covered by the skin; vertices are placed by regula falsi.
///
/// \param winding  of the whole oriented surface
/// \param skin     what is there already
/// \param seeds    points along open edges
HoleResult close_holes(const WindingNumber& winding, const SurfaceMesh& skin, const Points& seeds,
                       const HoleOptions& options, RunContext& run);

}  // namespace remesh
