#pragma once

#include <cstdint>
#include <optional>

#include "core/geometry/winding_number.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

struct SkinResult {
    SurfaceMesh surface{};      ///< What separates inside from outside.
    double area = 0.0;          ///< Of the skin.
    double dropped_area = 0.0;  ///< Of what isn't skin: inner sheets, fins, overlaps.
    double sound_area = 0.0;    ///< Of the triangles with w near 1 behind and near 0 in front.
    std::int64_t dropped = 0;   ///< Triangles that were dropped whole.
    std::optional<Vec3> first_dropped{};  ///< Middle of the first of them.
    bool was_split = false;  ///< Whether triangles of `surface` are parts of the input's.
};

/// Keeps the parts of a surface that separate inside (winding number w above 1/2) from outside.
///
/// Each triangle is tested in pieces of about h: w on both sides of the centroid, close by, and
/// where that isn't clear, 0.1 h away. So fins, inner sheets and overlaps of parts go.
///
/// \param surface  oriented
/// \param winding  of that surface
SkinResult find_skin(const SurfaceMesh& surface, const WindingNumber& winding, double h,
                     RunContext& run);

}  // namespace remesh
