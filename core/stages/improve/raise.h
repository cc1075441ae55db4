#pragma once

#include <cstdint>

#include "core/stages/improve/live_mesh.h"
#include "core/stages/improve/smooth.h"
#include "core/stages/improve/star.h"

namespace remesh::improve {

enum class Effort : std::uint8_t {
    Newton,  ///< Steps of the star's steep energy only.
    Full,    ///< Then ascent of the worst elements themselves.
};

/// Moves one vertex so that the worst element of its star (see Star::worst) gets as good as it can:
/// Newton steps of the star's steep energy, then ascent along the steepest direction common to the
/// elements that are about as bad as the worst one. Serial, recorded. Returns whether it moved.
///
/// Source: Freitag, Ollivier-Gooch, Tetrahedral mesh improvement using swapping and smoothing,
/// 1997.
bool raise_worst(LiveMesh& mesh, const Shape& shape, Index v, Effort effort, Star& star);

}  // namespace remesh::improve
