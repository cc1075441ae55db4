#pragma once

#include <array>

#include "core/mesh/mesh.h"

namespace remesh {

/// The A15 lattice (beta tungsten): 8 sites a cubic cell, in units of the cell. Its Delaunay
/// triangulation has 46 tets a cell, of two shapes, and no more than four sites on any of their
/// spheres: the next one is 0.14 cells away from the nearest.
inline const std::array<Vec3, 8> kA15Sites{{{0.0, 0.0, 0.0},
                                            {0.5, 0.5, 0.5},
                                            {0.25, 0.5, 0.0},
                                            {0.75, 0.5, 0.0},
                                            {0.0, 0.25, 0.5},
                                            {0.0, 0.75, 0.5},
                                            {0.5, 0.0, 0.25},
                                            {0.5, 0.0, 0.75}}};

/// Where such a lattice lies; nowhere if its cell is 0.
struct Lattice {
    Vec3 origin = Vec3::Zero();
    double cell = 0.0;  ///< Edge, model units.
};

}  // namespace remesh
