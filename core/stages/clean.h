#pragma once

#include <optional>
#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"
#include "core/stages/prepare.h"

namespace remesh {

/// Triangles that can be computed with, and what they were like.
struct CleanResult {
    SurfaceMesh surface{};  ///< Unused vertices left out.
    InputFacts facts{};     ///< All but the volume.
    std::vector<Defect> defects{};
    std::optional<Vec3> first_non_manifold{};  ///< An edge with more than two triangles.
};

/// Box of the coordinates that are neither infinite nor absurdly far from all others.
[[nodiscard]] Box plausible_box(const Points& vertices);

/// False for points that aren't finite.
[[nodiscard]] inline bool contains(const Box& box, const Vec3& point) {
    return (point.array() >= box.low.array()).all() && (point.array() <= box.high.array()).all();
}

/// Welds equal positions; drops triangles that aren't finite, have no area, or repeat another one
/// (in either direction). Patches stay.
///
/// \param h  wanted edge length, for the density of sharp edges
/// \throws Error{InvalidInput} if nothing with area is left
CleanResult clean_surface(const SurfaceMesh& input, double h, RunContext& run);

}  // namespace remesh
