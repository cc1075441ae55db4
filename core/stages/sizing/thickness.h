#pragma once

#include <vector>

#include "core/geometry/domain.h"
#include "core/geometry/sample_source.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"
#include "core/stages/sizing/probes.h"

namespace remesh {

/// Samples where the body, or the gap to its next wall, is too thin for the h of `field` to give
/// two layers of elements: they ask for what is needed, but for no less than `least_factor` times
/// h.
[[nodiscard]] std::vector<SizingSample> guard_thickness(const Domain& domain,
                                                        const SizingField& field,
                                                        double least_factor, RunContext& run);

/// Edge length that puts `elements` edges across the body at a probe: from the median over a cone
/// of rays inward. Model units; infinite where the body is thicker than `h_max` asks for.
[[nodiscard]] double size_across(const Domain& domain, const Probe& probe, double elements,
                                 double h_max);

}  // namespace remesh
