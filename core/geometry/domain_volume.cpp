#include "core/geometry/domain_volume.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/parallel.h"

namespace remesh {
namespace {

/// How much of the cube around a middle lies inside, as far as that's known; a negative share says
/// that the boundary goes through and the cube is to be split.
double share_inside(const Domain& domain, const Vec3& middle, double size, bool is_leaf) {
    const double reach = (is_leaf ? 0.5 : 0.5 * std::numbers::sqrt3) * size;
    const auto nearest = domain.closest_within(middle, reach);
    if (nearest && !is_leaf) {
        return -1.0;
    }
    const double depth = nearest ? nearest->distance / size : 0.5;
    return domain.region_at(middle) != 0 ? 0.5 + depth : 0.5 - depth;
}

}  // namespace

double volume_inside(const Domain& domain, double cell, const RunContext& run) {
    const Box box = domain.bounds();
    if (box.is_empty()) {
        return 0.0;
    }
    // A grid that planes of a model rarely share.
    const Vec3 center = 0.5 * (box.low + box.high) + cell * Vec3(0.171, 0.237, 0.123);
    double size = cell;
    while (size < (box.high - box.low).maxCoeff() + 2.0 * cell) {
        size *= 2.0;
    }
    double volume = 0.0;
    Points middles{center};
    while (!middles.empty()) {
        const bool is_leaf = size < 1.5 * cell;
        std::vector<double> share(middles.size());
        for_each_index(middles.size(), run, [&](std::size_t i) {
            share[i] = share_inside(domain, middles[i], size, is_leaf);
        });
        Points next;
        double sum = 0.0;
        for (std::size_t i = 0; i < middles.size(); ++i) {
            if (share[i] >= 0.0) {
                sum += share[i];
                continue;
            }
            for (int k = 0; k < 8; ++k) {
                const Vec3 way((k & 1) - 0.5, ((k >> 1) & 1) - 0.5, (k >> 2) - 0.5);
                next.push_back(middles[i] + 0.5 * size * way);
            }
        }
        volume += sum * size * size * size;
        middles.swap(next);
        size *= 0.5;
    }
    return volume;
}

}  // namespace remesh
