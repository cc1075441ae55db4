#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/geometry/domain.h"
#include "core/geometry/particles.h"
#include "core/run_context.h"
#include "core/stages/carve.h"
#include "core/stages/features.h"

namespace remesh {

enum class ImproveMode {
    Balanced,        ///< Smoothing, flips and collapses: mean quality and worst elements.
    StrictDelaunay,  ///< Nothing that would leave the restricted Delaunay complex: no improvement
                     ///< at all.
    MaxMinAngle,     ///< Worst element first, at some cost in the mean.
};

/// What the mesh is for.
enum class Aim : std::uint8_t {
    Body,     ///< Tets, and the surface around them.
    Surface,  ///< The surface alone: its tets need only be valid.
};

struct ImproveOptions {
    ImproveMode mode = ImproveMode::Balanced;
    int passes = 8;               ///< Of flips and smoothing, >= 0.
    double power = 3.0;           ///< Of the energy sum(phi^power), in [1, 12].
    double surface_weight = 5.0;  ///< Of boundary triangles in the energy, >= 0.
    double flip_below =
        0.75;  ///< Flips are tried on tets with a radius ratio below this, in [0, 1].
};

struct ImproveResult {
    TetMesh mesh{};                    ///< Unused vertices left out; free of any Faults.
    std::vector<Triangle> boundary{};  ///< boundary_of(mesh.tets).
    std::vector<ParticleKind> kind{};  ///< #V.
    std::vector<Index> curve{};        ///< #V curve of Curve vertices, else kNone.
    std::int64_t flips = 0;
    std::int64_t collapses = 0;
    std::int64_t splits = 0;  ///< Vertices inserted.
    int rounds = 1;           ///< Restarts with frozen vertices until the result checked out.
    std::int64_t frozen_vertices = 0;
};

/// Raises the worst elements and the mean by smoothing, flips and collapses, keeping the mesh
/// valid.
///
/// Volume vertices move freely, surface vertices are projected to the domain, curve vertices slide
/// along their curves, corners stay. Every result is checked exactly, as it is returned, for
/// inversions, manifoldness and self-intersection; where a check fails, the vertices there and a
/// growing ring are frozen and the improvement starts again from the carved mesh. The last resort
/// moves no surface vertex. At last what was frozen is improved, too, one operation at a time, each
/// checked against the boundary. Energy: phi = sum(l^2) / (12 (3V)^(2/3)) over tets, and its 2-D
/// sibling over boundary triangles. Same bytes for any number of threads.
///
/// \param anchor  #V facet of a surface vertex or curve of a curve vertex, as in Particles
/// \param enter  told when a check begins (Verify) and when the improvement goes on (Improve)
/// \throws Error{Unmeshable} if even the carved mesh isn't valid: with the place, which a warning
/// tells, too, and after showing the surface; Error{InvalidInput}; Error{Cancelled}
ImproveResult improve_mesh(
    const CarveResult& carved, const std::vector<Index>& anchor, const Domain& domain,
    const FeatureSet& features, const ImproveOptions& options, RunContext& run, Aim aim = Aim::Body,
    const std::function<void(Stage)>& enter = [](Stage) {});

void validate(const ImproveOptions& options);

}  // namespace remesh
