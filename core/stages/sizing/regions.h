#pragma once

#include <memory>

#include "core/geometry/domain.h"
#include "core/geometry/sizing_source.h"
#include "core/stages/sizing.h"

namespace remesh {

/// Slope of h at which sizes grow by `growth` from one layer of elements to the next, 0.85 edges
/// higher.
[[nodiscard]] double slope_of(double growth);

/// A region of the options as a source.
///
/// \param gradation  for a region without a growth of its own
[[nodiscard]] std::shared_ptr<const SizingSource> make_region(const SizingRegion& region,
                                                              double gradation);

/// Sizes that grow with the distance from the boundary. Keeps a reference to `domain`.
[[nodiscard]] std::shared_ptr<const SizingSource> make_layer(const Domain& domain,
                                                             const BoundaryLayer& layer);

}  // namespace remesh
