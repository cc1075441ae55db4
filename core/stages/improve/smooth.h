#pragma once

#include <vector>

#include "core/geometry/domain.h"
#include "core/run_context.h"
#include "core/stages/features.h"
#include "core/stages/improve/live_mesh.h"
#include "core/stages/improve/star.h"

namespace remesh::improve {

/// Where vertices of the boundary may be.
struct Shape {
    const Domain& domain;
    const FeatureSet& features;
};

struct Place {
    Vec3 point = Vec3::Zero();
    Index anchor = kNone;
};

/// The nearest place a vertex of some kind may be at.
[[nodiscard]] Place place_on(const Shape& shape, ParticleKind kind, Index anchor,
                             const Vec3& point);

struct SmoothResult {
    std::int64_t moved = 0;
    double max_move = 0.0;  ///< Relative to the mean edge at the vertex.
    double sum_squares = 0.0;
};

/// One sweep of Newton steps over all vertices around which something changed, colour by colour:
/// no two vertices of one colour share a tet, so that each colour runs on all threads and the
/// result is the same for any number of them. A vertex moves only where its energy falls and no
/// tet of its star gets inverted.
///
/// \param floor  no star gets an element worse than this (see Star::worst) that had none; 0: any
SmoothResult smooth_vertices(LiveMesh& mesh, const Shape& shape, double power,
                             double surface_weight, double floor, const RunContext& run);

/// Direction a vertex of the boundary is bound by: the surface's normal or the curve's tangent;
/// zero for others.
[[nodiscard]] Vec3 bound_axis(const LiveMesh& mesh, const Shape& shape, Index v, const Star& star);

/// Newton direction in the whole space, in the tangent plane of a surface, or along a curve;
/// steepest descent where the Hessian isn't positive.
[[nodiscard]] Vec3 descent(const Star::Model& model, ParticleKind kind, const Vec3& axis);

/// By how much a triangle leaves the domain's boundary, over its mean edge, and turns from facing
/// outward, as cosine, beyond what its size excuses; 0 if it follows the boundary.
[[nodiscard]] double departure(const Shape& shape, const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace remesh::improve
