#pragma once

#include <limits>
#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// How the paper's refinement map c moves through the volume: dc/dt = div grad c + R c.
struct DiffusionOptions {
    double reaction = 0.0;  ///< R, 1 / (model unit)^2, < 0: c falls off over 1 / sqrt(-R).
    double time = std::numeric_limits<double>::infinity();  ///< Model unit^2, > 0; infinite: to the
                                                            ///< steady state.
};

/// One implicit Euler step of the diffusion on a mesh, by linear finite elements with lumped mass.
/// Source: Szczerba, McGregor, Szekely, ICCS 2007, the refinement map.
///
/// No flow through the boundary but where c is fixed. Flat tets take no part, and points that are
/// in no other tet keep their c.
/// \param points    #P positions, model units
/// \param tets      indices of the points, positively oriented
/// \param c         #P values before the step
/// \param is_fixed  #P, not 0 where c stays
/// \return #P values after it
/// \throws Error{Cancelled}
std::vector<double> diffuse(const Points& points, const std::vector<Tet>& tets,
                            std::vector<double> c, const std::vector<char>& is_fixed,
                            const DiffusionOptions& options, const RunContext& run);

}  // namespace remesh
