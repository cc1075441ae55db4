#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/exact/delaunay.h"
#include "core/geometry/domain.h"
#include "core/geometry/particles.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

struct CarveOptions {
    double min_part_volume = 4.0;  ///< Parts smaller than this times h^3 go, >= 0,
    double min_part_share = 1e-3;  ///< or than this share of the largest, in [0, 1).
    double max_void_volume = 1.0;  ///< Enclosed voids smaller than this times h^3 are filled, >= 0.
};

struct CarveResult {
    TetMesh mesh{};  ///< Vertices are the particles, in order, unused ones included.
    std::vector<ParticleKind>
        kind{};  ///< #V. Volume for what isn't on the boundary, Surface or more for what is.
    std::int64_t dropped_parts = 0;      ///< Crumbs included.
    std::int64_t notable_parts = 0;      ///< Of them, those of 1 h^3 at least.
    std::optional<Vec3> notable_part{};  ///< A point in the first of these.
    std::int64_t filled_voids = 0;
    std::int64_t forced_steps = 0;  ///< Of the last resort of the manifold labelling.
};

/// Takes the tets that lie inside, so that their boundary is closed and edge- and vertex-manifold.
/// Tets keep the order they have in `delaunay`.
///
/// A tet with a volume vertex stays (unless its circumradius passes h and its centroid is outside);
/// one with surface vertices only is judged by the domain at its circumcentre (restricted Delaunay;
/// at the centroid where the circumradius passes 1.2 h), and is out if it is flat. Here h is the
/// mean `particles.h` of its corners. Then a greedy labelling switches tets around vertices whose
/// boundary isn't one fan, and a last resort that only removes, so that it always ends manifold.
/// The largest part always stays. Since Delaunay tets don't overlap, the boundary has no
/// self-intersection either.
///
/// \param delaunay  of the particles, from `tetrahedralize`
/// \throws Error{InvalidInput} if an option is out of range; Error{Unmeshable} if nothing is left;
/// Error{Cancelled}
CarveResult carve_domain(const Particles& particles, const TetComplex& delaunay,
                         const Domain& domain, const CarveOptions& options, RunContext& run);

/// \throws Error{InvalidInput} naming the field, its range and the value
void validate(const CarveOptions& options);

}  // namespace remesh
