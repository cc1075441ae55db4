#pragma once

#include "core/stages/improve/live_mesh.h"
#include "core/stages/improve/smooth.h"

namespace remesh::improve {

/// Contracts the edge (v, w) onto w, which stays where it is, if that raises the worst dihedral
/// sine or scaled angle sine (see Star::worst) of all that touched v.
///
/// A surface vertex goes only along an edge of the boundary, where the full link condition holds,
/// the normals stay within 37 degrees and no triangle gets a poor angle. Curve vertices and corners
/// stay.
bool collapse_edge(LiveMesh& mesh, Index v, Index w);

/// Contracts (v, w) onto w whatever becomes of the angles, as a first step of something larger, if
/// topology, orientation and shape allow it: the new triangles have to follow the domain's
/// boundary. A curve vertex may go along its curve, where that is nearly straight.
bool contract_edge(LiveMesh& mesh, const Shape& shape, Index v, Index w);

}  // namespace remesh::improve
