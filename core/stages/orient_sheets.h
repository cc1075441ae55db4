#pragma once

#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// Says which of several open parts must turn around, so that together they enclose a body.
///
/// Right means that the winding number of all of them is 1/2 on each. A part that all but encloses
/// a body by itself stays as it is.
///
/// \param parts  triangles of each part, oriented alike within; some 100 at most
/// \return       #parts flags
std::vector<char> find_turned_sheets(const SurfaceMesh& surface,
                                     const std::vector<const std::vector<Index>*>& parts,
                                     RunContext& run);

}  // namespace remesh
