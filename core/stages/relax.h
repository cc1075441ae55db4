#pragma once

#include "core/geometry/domain.h"
#include "core/geometry/particles.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"
#include "core/stages/features.h"

namespace remesh {

/// The paper's two families of forces between particles.
enum class ForceLaw {
    Springs,           ///< Preloaded Hookean springs that push only: f = rc - s, s = r / h.
    ChargedParticles,  ///< Magnetic power law, shifted to vanish at rc: f = s^-p - rc^-p.
};

enum class Integrator {
    DampedDynamics,   ///< M r'' + D r' = F, the paper's.
    GradientDescent,  ///< Overdamped: r' = F / K.
    Fire,             ///< Fast inertial relaxation engine (Bitzek et al. 2006).
};

struct RelaxOptions {
    ForceLaw force = ForceLaw::Springs;
    Integrator integrator = Integrator::DampedDynamics;
    double mass = 1.0;     ///< M of the paper, in units of stiffness times time step squared, > 0.
    double damping = 0.5;  ///< D of the paper, as a fraction of critical damping, in (0, 2].
    double charge_exponent = 2.0;      ///< p of the power law, in [1, 6].
    int max_surface_iterations = 120;  ///< >= 0.
    int max_volume_iterations = 40;    ///< >= 0.
    double tolerance =
        3e-3;  ///< Converged once the rms step to equilibrium is below tolerance * h, > 0.
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
/// particles, which move tangentially and are snapped back after every step (the paper's magnetic
/// snapping). Gathers forces (Jacobi), so the result doesn't depend on the number of threads.
/// Source: Szczerba, McGregor, Szekely, ICCS 2007, steps 3 to 7.
/// \throws Error{InvalidInput}; Error{Cancelled}
RelaxResult relax_surface(const Particles& particles, const Domain& domain,
                          const FeatureSet& features, const SizingField& sizing,
                          const RelaxOptions& options, RunContext& run);

/// Relaxes the volume particles near the boundary while all others stand still.
/// \throws Error{InvalidInput}; Error{Cancelled}
RelaxResult relax_volume(const Particles& particles, const Domain& domain,
                         const SizingField& sizing, const RelaxOptions& options, RunContext& run);

void validate(const RelaxOptions& options);

}  // namespace remesh
