#pragma once

#include <cstdint>

#include "core/geometry/winding_number.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

struct SmoothOptions {
    double h = 0.0;          ///< Wanted edge length, model units.
    double mean_edge = 0.0;  ///< Of the input, model units.
    double detail = 0.0;     ///< What is smaller is damage, model units.
    double stairs = 0.0;     ///< Length of stairs, model units; smoothed as far as not noise.
    double reach = 0.0;      ///< Bound of the displacement by projection, model units.
};

struct SmoothResult {
    SurfaceMesh surface{};
    Points normals{};               ///< #V unit, outward.
    bool noisy = false;             ///< Rough all over: neither volume nor thin parts were minded.
    double max_displacement = 0.0;  ///< Model units.
    double mean_displacement = 0.0;
    std::int64_t unmoved = 0;         ///< Vertices for which no smooth place was found.
    std::int64_t parts_kept_raw = 0;  ///< Closed parts whose volume would have changed too much.
};

/// Moves the vertices of a skin to the level 1/2 of the mollified winding number.
///
/// The kernel's radius shrinks where the body is thinner than it. Closed parts are then offset to
/// the volume they had; one that still differs by over 2 % stays as it was. At last all moves
/// outward where it is curved, by what triangles of edge length h would cut off.
///
/// \param skin     no unused vertices
/// \param winding  of the whole oriented surface
SmoothResult smooth_skin(SurfaceMesh skin, const WindingNumber& winding,
                         const SmoothOptions& options, RunContext& run);

}  // namespace remesh
