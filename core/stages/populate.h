#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/exact/delaunay.h"
#include "core/geometry/domain.h"
#include "core/geometry/particles.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"

namespace remesh {

struct PopulationOptions {
    int passes = 2;  ///< Each a Delaunay tetrahedralization and a relaxation, where sizes vary, in
                     ///< [0, 20].
};

struct PopulationResult {
    Particles particles{};  ///< Those that were there in their order, then the new ones.
    std::vector<std::array<Index, 2>>
        origin{};  ///< Of each: itself before, twice, or the ends of the edge it came into.
    std::int64_t inserted = 0;
    std::int64_t removed = 0;
};

/// Population control: puts volume particles in the middle of Delaunay edges longer than 1.35 h,
/// and takes the more crowded end off those shorter than 0.7 h. Boundary particles stay; no
/// particle takes part twice. Edges between boundary particles, and middles outside or near the
/// wall, don't count.
///
/// \param delaunay  of the particles, from `tetrahedralize`
/// \throws Error{Cancelled}
PopulationResult control_population(const Particles& particles, const TetComplex& delaunay,
                                    const Domain& domain, const SizingField& sizing,
                                    RunContext& run);

/// \throws Error{InvalidInput} naming the field, its range and the value
void validate(const PopulationOptions& options);

}  // namespace remesh
