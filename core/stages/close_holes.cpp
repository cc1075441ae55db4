#include "core/stages/close_holes.h"

#include <algorithm>
#include <utility>

#include "core/geometry/bvh.h"
#include "core/geometry/edge_table.h"
#include "core/stages/march_level.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

class WindingLevel : public LevelField {
public:
    explicit WindingLevel(const WindingNumber& winding) : winding_(winding) {}

    [[nodiscard]] double depth(const Vec3& point) const override {
        return winding_.at(point) - 0.5;
    }

private:
    const WindingNumber& winding_;
};

/// Finds the largest connected patch.
void measure(HoleResult& result) {
    const SurfaceMesh& patches = result.patches;
    DisjointSets sets(patches.vertices.size());
    std::vector<double> area(patches.vertices.size(), 0.0);
    std::vector<Vec3> moment(patches.vertices.size(), Vec3::Zero());
    for (const Triangle& t : patches.triangles) {
        sets.merge(t[0], t[1]);
        sets.merge(t[1], t[2]);
    }
    for (std::size_t i = 0; i < patches.triangles.size(); ++i) {
        const auto root = static_cast<std::size_t>(sets.find(patches.triangles[i][0]));
        const double a = area_vector(patches, i).norm();
        result.area += a;
        area[root] += a;
        moment[root] += a * centroid(patches, i);
    }
    if (!patches.triangles.empty()) {
        const auto best = std::max_element(area.begin(), area.end());
        result.largest = moment[static_cast<std::size_t>(best - area.begin())] / *best;
    }
}

}  // namespace

HoleResult close_holes(const WindingNumber& winding, const SurfaceMesh& skin, const Points& seeds,
                       const HoleOptions& options, RunContext& run) {
    HoleResult result;
    if (seeds.empty()) {
        return result;
    }
    const Bvh covered(skin.vertices, skin.triangles);
    const Box box = bounding_box(skin.vertices);
    const WindingLevel field(winding);
    double cell = options.cell;
    double gap = options.gap;
    for (;;) {
        run.checkpoint();
        auto patches =
            march_level(field, covered, {}, seeds,
                        {.origin = grid_origin(box, cell), .cell = cell, .gap = gap}, run);
        if (patches) {
            result.patches = std::move(*patches);
            result.cell = cell;
            measure(result);
            return result;
        }
        cell *= 2.0;
        gap *= 2.0;
    }
}

}  // namespace remesh
