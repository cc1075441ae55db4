#pragma once

#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"
#include "core/stages/prepare.h"

namespace remesh {

struct OrientResult {
    SurfaceMesh surface{};  ///< Facing outward as far as that can be told.
    std::vector<Defect> defects{};
};

/// Makes triangles face outward and drops parts that aren't walls of the body.
///
/// Parts are connected over edges with two triangles. Within one, directions follow from edge to
/// edge and the larger area wins; a part that lies in no other faces outward; what lies in another
/// keeps its direction relative to it. Double walls, specks and (unless kept) cavities go. Pieces
/// of a few triangles turn to where the winding number of all the others is higher behind them.
///
/// \param surface  cleaned: welded, without degenerate and duplicate triangles
/// \param h        wanted edge length, model units: walls nearer than about that are one
OrientResult orient_surface(const SurfaceMesh& surface, double h, const PrepareOptions& options,
                            RunContext& run);

}  // namespace remesh
