#pragma once

#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"
#include "core/stages/sizing/probes.h"

namespace remesh {

/// Larger principal curvature of a surface at points spread over it, from quadrics fitted over
/// several times their spacing, so that stairs aren't curvature.
///
/// \param spacing  of the probes, about
/// \param keep_apart  whether what lies across an edge bent by more than 40 degrees is another
///                    surface, as on bodies with features
/// \return #probes curvatures, 1 / model units, >= 0; 0 where there are too few points to tell
[[nodiscard]] std::vector<double> estimate_curvature(const SurfaceMesh& surface,
                                                     const std::vector<Probe>& probes,
                                                     double spacing, bool keep_apart,
                                                     RunContext& run);

/// Medians of `values` over the probes within two spacings that face the same way.
[[nodiscard]] std::vector<double> median_nearby(const SurfaceMesh& surface,
                                                const std::vector<Probe>& probes,
                                                const std::vector<double>& values, double spacing,
                                                bool keep_apart, RunContext& run);

}  // namespace remesh
