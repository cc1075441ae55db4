#pragma once

#include <optional>

#include "core/geometry/domain.h"
#include "core/geometry/particles.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"
#include "core/stages/features.h"

namespace remesh {

/// The paper's two families of forces between particles.
enum class ForceLaw {
    Springs,           ///< Preloaded springs that push only, s = r / h: Hookean in the volume,
                       ///< f = 1 - s / rc; progressive on the surface, f = (1 - s / rc)^2.
    ChargedParticles,  ///< Magnetic power law, shifted to vanish at rc: f = s^-p - rc^-p.
};

enum class Integrator {
    DampedDynamics,   ///< M r'' + D r' = F, the paper's.
    GradientDescent,  ///< Overdamped: r' = F / (2 K), K the particle's own stiffness.
    Fire,             ///< Fast inertial relaxation engine (Bitzek et al. 2006).
};

struct RelaxOptions {
    ForceLaw force = ForceLaw::Springs;
    Integrator integrator = Integrator::DampedDynamics;
    double mass = 0.6;      ///< M of the paper, in units of stiffness times time step squared, > 0.
    double damping = 0.12;  ///< D of the paper, as a fraction of critical damping, in (0, 2].
    double charge_exponent = 2.0;                ///< p of the power law, in [1, 6].
    int max_surface_iterations = 120;            ///< >= 0.
    std::optional<int> max_volume_iterations{};  ///< >= 0; absent: 25, or 60 in a run whose sizes
                                                 ///< vary, as there is no lattice to start from.
    double tolerance =
        1e-3;  ///< Converged once the rms step to equilibrium is below tolerance * h, > 0.
    double active_depth =
        1.5;  ///< Only volume particles within this many h of the boundary move, > 0.
};

/// How a relaxation ended.
struct RelaxResult {
    Particles particles{};
    int iterations = 0;
    double residual = 0.0;   ///< rms step to equilibrium over h at the end.
    bool converged = false;  ///< False when the iteration limit came first: poorer, not an error.
};

/// Relaxes what lies on the boundary: curve particles along their curves first, then surface
/// particles, which move tangentially and are snapped back once they have slid 0.05 h, and at the
/// end (the paper's magnetic snapping). Pairs that end closer than 0.4 h on one sheet lose the
/// later of the two. Gathers forces (Jacobi), so the result doesn't depend on the number of
/// threads. Source: Szczerba, McGregor, Szekely, ICCS 2007, steps 3 to 7. \throws
/// Error{InvalidInput}; Error{Cancelled}
RelaxResult relax_surface(const Particles& particles, const Domain& domain,
                          const FeatureSet& features, const SizingField& sizing,
                          const RelaxOptions& options, RunContext& run);

/// Relaxes the volume particles near the boundary while all others stand still.
/// \throws Error{InvalidInput}; Error{Cancelled}
RelaxResult relax_volume(const Particles& particles, const Domain& domain,
                         const SizingField& sizing, const RelaxOptions& options, RunContext& run);

void validate(const RelaxOptions& options);

}  // namespace remesh
