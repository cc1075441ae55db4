#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/domain.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"
#include "core/stages/features.h"
#include "core/stages/improve.h"

namespace remesh {

/// Where the patches of the result come from.
enum class PatchSource {
    Input,  ///< The input's own patches, if it has any.
    Faces,  ///< Parts of the surface between feature curves, numbered by size.
    None,
};

/// Gives each triangle the patch of the domain's boundary nearest to it: what most of four points
/// of it are nearest to. Then triangles astride a border join the patch that two of their
/// neighbours have, so that borders don't zigzag, and what closes a pinhole takes the patches
/// around it. Numbers and names are the domain's; a patch of which no triangle is left is told as a
/// warning PATCH_LOST.
///
/// Does nothing where the boundary has no patches.
///
/// \param surface  closed, from `boundary_surface`
/// \throws Error{Cancelled}
void carry_patches(const Domain& domain, SurfaceMesh& surface, RunContext& run);

/// Numbers the parts of the boundary that feature curves keep apart, largest area first.
///
/// \return patch of each triangle of boundary_of(improved.mesh.tets)
[[nodiscard]] std::vector<std::int32_t> number_faces(const FeatureSet& features,
                                                     const ImproveResult& improved);

}  // namespace remesh
