#pragma once

#include <cstdint>

#include "core/run_context.h"
#include "core/stages/improve/live_mesh.h"

namespace remesh::improve {

/// Which quality a flip has to raise.
enum class Judge {
    RadiusRatio,   ///< For the mean and the low quantiles.
    DihedralSine,  ///< For the worst angles.
};

/// Removes an edge by retriangulating its ring of at most 8 vertices so that the worst tet gets as
/// good as possible (dynamic programming), if that is better than the worst tet there was.
///
/// An edge of the boundary is flipped to the other diagonal of its two triangles, where their
/// normals agree within 37 degrees and their angles don't get worse.
bool remove_edge(LiveMesh& mesh, Index a, Index b, Judge judge);

/// Replaces the face opposite of a corner of a tet, and the two tets at it, by an edge and three.
bool remove_face(LiveMesh& mesh, Index t, std::size_t corner, Judge judge);

/// The first of 6 edge and 4 face removals of a tet that helps.
bool flip_tet(LiveMesh& mesh, Index t, Judge judge);

/// Tries all tets with a radius ratio below `limit` around which something changed (or all of
/// them), in order, planned side by side. Returns the number of flips.
std::int64_t flip_pass(LiveMesh& mesh, double limit, bool all, const RunContext& run);

}  // namespace remesh::improve
