#pragma once

#include "core/stages/sizing.h"
#include "remesh/v1/options.pb.h"

namespace remesh {

/// \throws JobError{BadRequest} for coordinates that aren't 3 a point and a region without a shape
[[nodiscard]] SizingOptions to_core(const v1::Sizing& from);
[[nodiscard]] v1::Sizing to_proto(const SizingOptions& from);

}  // namespace remesh
