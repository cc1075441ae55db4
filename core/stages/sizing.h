#pragma once

#include <memory>

#include "core/geometry/domain.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"

namespace remesh {

struct SizingOptions {
    double edge_length = 0.0;  ///< Wanted edge length h, model units, > 0.
    bool guard_thickness =
        true;  ///< Refine where the body, or the gap beside it, is thinner than about 1.4 h.
    double min_factor = 0.5;  ///< The guard refines to no less than this times h, in (0, 1].
    double gradation = 0.5;   ///< How fast h may grow with distance, in (0, 1].
};

/// Builds h(x): uniform, or refined near thin parts and graded from there.
/// \throws Error{InvalidInput} if an option is out of range
std::shared_ptr<const SizingField> build_sizing_field(const Domain& domain,
                                                      const SizingOptions& options,
                                                      RunContext& run);

void validate(const SizingOptions& options);

}  // namespace remesh
