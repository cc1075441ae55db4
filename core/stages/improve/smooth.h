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
SmoothResult smooth_vertices(LiveMesh& mesh, const Shape& shape, double power,
                             double surface_weight, const RunContext& run);

/// Newton steps for one vertex, serial, recorded; a step counts only if the worst element of the
/// star (see Star::worst) gets better. Returns whether the vertex moved.
bool raise_worst(LiveMesh& mesh, const Shape& shape, Index v, double triangle_scale, Star& star);

}  // namespace remesh::improve
