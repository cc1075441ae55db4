#pragma once

#include "core/geometry/domain.h"
#include "core/run_context.h"

namespace remesh {

/// Volume of a domain's inside, model units cubed; unlike a sum over triangles right also where
/// the boundary has gaps.
///
/// An octree is refined toward the boundary; a cell there counts by its middle's signed distance.
/// Time grows with (area / cell^2).
///
/// \param cell  size of the smallest cells, model units, > 0; the error is about a hundredth of
///              the area times it
/// \throws Error{Cancelled}
[[nodiscard]] double volume_inside(const Domain& domain, double cell, const RunContext& run);

}  // namespace remesh
