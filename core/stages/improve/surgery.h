#pragma once

#include "core/stages/improve/live_mesh.h"
#include "core/stages/improve/smooth.h"

// Changes that are made whatever becomes of the angles, as first steps of something larger. Each
// keeps the boundary a manifold that follows the domain; where it can't, it does nothing.
namespace remesh::improve {

/// Puts a vertex in the middle of an edge: on its curve, on the boundary, or in the volume.
bool split_edge(LiveMesh& mesh, const Shape& shape, Index a, Index b);

/// Puts a vertex in the middle of a tet, or of a face between two: the one opposite of `corner`.
bool split_tet(LiveMesh& mesh, Index t);
bool split_face(LiveMesh& mesh, Index t, std::size_t corner);

/// Takes off the only tet at an edge of the boundary.
bool peel_edge(LiveMesh& mesh, const Shape& shape, Index a, Index b);

/// Lays a tet over an edge of the boundary whose two triangles form a valley.
bool fill_valley(LiveMesh& mesh, const Shape& shape, Index a, Index b);

/// Takes off the only tet at a vertex, or lays one over the three triangles of a dimple.
bool level_vertex(LiveMesh& mesh, const Shape& shape, Index v);

}  // namespace remesh::improve
