#pragma once

#include <cstdint>
#include <optional>

#include "core/geometry/domain.h"
#include "core/geometry/particles.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"
#include "core/stages/features.h"

namespace remesh {

struct SeedOptions {
    double dart_radius = 0.735;  ///< Of surface darts, as a fraction of local h, in [0.5, 1].
    double preload =
        0.94;  ///< Lattice spacing over h: below 1 the particles start compressed, in [0.7, 1.2].
    double wall_distance = 0.45;  ///< Volume particles closer to the boundary than this times h are
                                  ///< dropped, in [0.2, 1].
    std::uint64_t seed = 1;       ///< Changes the darts and the lattice's origin, nothing else.
    std::int64_t max_particles = 400'000'000 / 6;  ///< More are refused: six tets each are 400
                                                   ///< million, whose faces 32 bits can number.
};

/// Puts particles on corners, along curves (about h apart) and, by dart throwing, on the boundary.
/// Order of the result: corners, curves, surface. Deterministic for a seed and any number of
/// threads. \throws Error{TooLarge} if max_particles would be passed; Error{InvalidInput};
/// Error{Cancelled}
Particles seed_surface(const Domain& domain, const FeatureSet& features, const SizingField& sizing,
                       const SeedOptions& options, RunContext& run);

/// Appends volume particles (A15 lattice; darts where h varies) to those on the boundary.
///
/// \param surface  corners, curves and surface particles, already relaxed
/// \param shell    only this many h deep from the boundary, if given (for surface-only jobs)
/// \throws Error{TooLarge} if max_particles would be passed; Error{Cancelled}
Particles seed_volume(const Particles& surface, const Domain& domain, const SizingField& sizing,
                      std::optional<double> shell, const SeedOptions& options, RunContext& run);

void validate(const SeedOptions& options);

}  // namespace remesh
