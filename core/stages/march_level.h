#pragma once

#include <optional>
#include <vector>

#include "core/geometry/bvh.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"

namespace remesh {

/// Something that is positive inside of a body and negative outside.
class LevelField {
public:
    LevelField() = default;
    LevelField(const LevelField&) = delete;
    LevelField& operator=(const LevelField&) = delete;
    virtual ~LevelField() = default;

    /// Any measure of depth; thread-safe.
    [[nodiscard]] virtual double depth(const Vec3& point) const = 0;
};

/// An origin that grid planes of a model rarely share.
[[nodiscard]] inline Vec3 grid_origin(const Box& box, double cell) {
    return box.low - cell * Vec3(2.37, 2.31, 2.43);
}

struct MarchOptions {
    Vec3 origin = Vec3::Zero();  ///< Of the grid, model units.
    double cell = 0.0;           ///< Size of the grid's cells, model units, > 0.
    double gap = 0.0;            ///< Triangles nearer than this to the skin aren't needed,
    double far_gap = 0.0;        ///< nor such nearer than this to a triangle not on a rim. >= gap.
    std::size_t max_cells = 500'000;
    std::optional<Box> bounds{};  ///< Where the level must stay.
};

/// Triangulates the level 0 of a field from the seeds on, as long as the skin doesn't cover it.
///
/// Marches over tets of a sparse grid; vertices are placed by regula falsi.
///
/// \param skin    what is there already
/// \param on_rim  #T of the skin: whether a triangle touches a rim; empty if that doesn't matter
/// \param seeds   points along open edges
/// \return        the triangles, facing outward, or nothing if there were too many cells or the
///                level left the bounds
/// \throws Error{Cancelled}
std::optional<SurfaceMesh> march_level(const LevelField& field, const Bvh& skin,
                                       const std::vector<char>& on_rim, const Points& seeds,
                                       const MarchOptions& options, RunContext& run);

}  // namespace remesh
