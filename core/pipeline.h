#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/mesh/mesh.h"
#include "core/run_context.h"
#include "core/stages/bounds.h"
#include "core/stages/carve.h"
#include "core/stages/features.h"
#include "core/stages/improve.h"
#include "core/stages/patches.h"
#include "core/stages/populate.h"
#include "core/stages/prepare.h"
#include "core/stages/relax.h"
#include "core/stages/report.h"
#include "core/stages/seed.h"
#include "core/stages/sizing.h"

namespace remesh {

struct RemeshOptions {
    std::optional<double>
        edge_length{};  ///< Wanted edge length, model units, > 0; absent: chosen from the input.
    bool tetrahedra = true;  ///< False: relax and mesh only a shell, return its outer surface.
    PrepareOptions prepare{};
    FeatureOptions features{};
    SizingOptions sizing{};
    SeedOptions seed{};
    RelaxOptions relax{};
    PopulationOptions population{};
    CarveOptions carve{};
    ImproveOptions improve{};
    PatchSource patches = PatchSource::Input;
    BoundOptions bounds{};  ///< Checked in the report; a result that breaks them is returned too.
    /// More tets than this make the edge length grow until they fit, >= 100; absent: any number.
    std::optional<std::int64_t> max_tets{};
};

struct RemeshResult {
    SurfaceMesh surface{};  ///< Closed, manifold, free of self-intersections, facing outward;
                            ///< its triangles in the order of boundary_of(tets.tets).
    TetMesh tets{};         ///< Empty for a surface-only run.
    std::vector<double> surface_sizes{};  ///< h(x) at the vertices of each, if asked for.
    std::vector<double> tet_sizes{};
    double edge_length = 0.0;  ///< That was asked for or chosen, raised where max_tets wanted it.
    QualityReport report{};
};

/// Remeshes any triangles: the paper's steps in order. Same input, options and build give the same
/// bytes for any number of threads; runs in the present TBB arena.
///
/// \param sizes  #V wanted edge lengths at the input's vertices, if options.sizing.vertex_field
/// \throws Error{InvalidInput} for an option out of range or an input that encloses no body;
/// Error{Unmeshable} if no valid mesh was found; Error{TooLarge} if max_tets or max_particles would
/// be passed; Error{Cancelled}
RemeshResult run_pipeline(const SurfaceMesh& input, const RemeshOptions& options, RunContext& run,
                          const std::vector<double>& sizes = {});

/// Checks every option of every stage.
/// \throws Error{InvalidInput} naming the field, its range and the value
void validate(const RemeshOptions& options);

}  // namespace remesh
