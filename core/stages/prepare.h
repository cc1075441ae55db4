#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/geometry/domain.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

enum class Smoothing {
    Automatic,  ///< On where the input shows voxel stairs or noise.
    Off,        ///< Particles sit on the input itself.
    On,
};

struct PrepareOptions {
    bool close_holes =
        true;  ///< Triangulate the winding number's 1/2 level where the input is open.
    Smoothing smoothing = Smoothing::Automatic;
    double max_displacement = 0.6;  ///< Of smoothing, as a fraction of min(mean input edge, h), or
                                    ///< of the edge where it is that of voxel stairs; in (0, 2].
    double speck_volume =
        1e-3;  ///< Closed parts below this share of the largest one's volume go, in [0, 1).
    bool keep_cavities = false;  ///< Cavities (inward shells inside a body) stay holes in the mesh.
};

/// One kind of damage that was found, and what was done about it.
struct Defect {
    std::string code{};         ///< Stable UPPER_SNAKE_CASE, e.g. "OPEN_BOUNDARY".
    std::string description{};  ///< What was found and what was done, a sentence with numbers.
    std::int64_t count = 0;     ///< How many.
    std::optional<Vec3> at{};   ///< Where the first (or largest) one is, model units.
};

/// Facts about the input as it came, before anything was repaired.
struct InputFacts {
    std::int64_t vertices = 0;    ///< After merging equal positions; unused ones left out.
    std::int64_t triangles = 0;   ///< As in the file.
    std::int64_t components = 0;  ///< Connected by edges.
    std::int64_t boundary_edges = 0;
    std::int64_t boundary_loops = 0;
    std::int64_t non_manifold_edges = 0;
    std::int64_t inconsistent_edges = 0;  ///< Whose two triangles run through them the same way.
    std::int64_t duplicate_triangles = 0;
    std::int64_t degenerate_triangles =
        0;                   ///< No area, or a vertex twice, or a coordinate that isn't finite.
    double area = 0.0;       ///< Model units squared.
    double volume = 0.0;     ///< Of the repaired body (|w| >= 1/2), model units cubed.
    double mean_edge = 0.0;  ///< Model units.
    double edge_variation = 0.0;  ///< Standard deviation of the edges' lengths over their mean.
    double sharp_edge_density =
        0.0;  ///< (length bent over 30 degrees) h / area: tells CAD, stairs and noise apart.
    Box bounds{};
};

struct PrepareResult {
    std::shared_ptr<const Domain> domain{};  ///< Region 0 outside, 1 inside.
    SurfaceMesh cleaned{};  ///< The input welded and oriented: what features are looked for on.
    InputFacts facts{};
    std::vector<Defect> defects{};
    bool smoothed = false;          ///< Whether `domain` is a displaced copy of the input.
    bool noisy = false;             ///< Too rough for features and volume correction.
    double max_displacement = 0.0;  ///< Of smoothing, model units.
};

/// Turns any triangles into a domain with an inside, an outside and a closed boundary.
///
/// Welds; drops degenerate, duplicate and non-finite triangles; orients parts by edges, area
/// majority, nesting and winding number; drops double walls and specks; keeps what separates inside
/// from outside (the skin test); closes holes along w = 1/2; smooths stairs and noise by projection
/// to a mollified winding number. Source: Barill et al., Fast Winding Numbers for Soups and Clouds,
/// 2018.
///
/// \param input  any triangles, indices in range
/// \param h      wanted edge length, model units, > 0: the scale below which detail is damage
/// \throws Error{InvalidInput} if an option is out of range or nothing with area is left
/// \throws Error{Unmeshable} if the triangles enclose no body
/// \throws Error{Cancelled}
PrepareResult prepare_surface(const SurfaceMesh& input, double h, const PrepareOptions& options,
                              RunContext& run);

/// \throws Error{InvalidInput} naming the field, its range and the value
void validate(const PrepareOptions& options);

/// Edge length suggested for an input: about its mean edge (over the area), but at least 2 and at
/// most 60 elements across the body's mean thickness (3 V / A) and at most about 2M tets.
/// \throws Error{InvalidInput} if nothing with area is there
double suggest_edge_length(const SurfaceMesh& input);

}  // namespace remesh
