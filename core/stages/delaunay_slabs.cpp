#include "core/stages/delaunay_slabs.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "core/mesh/index.h"
#include "core/parallel.h"
#include "core/stages/complete_cells.h"

namespace remesh {
namespace {

constexpr double kLayers = 2.5;               // Of points that a slab sees beyond its own.
constexpr std::size_t kLeastPoints = 10'000;  // Of a slab that is worth a thread.
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::size_t points_in_layers(std::size_t points) {
    return static_cast<std::size_t>(kLayers * std::pow(static_cast<double>(points), 2.0 / 3.0)) + 1;
}

/// Along an axis, open on both sides.
struct Interval {
    double low = -kInfinity;
    double high = kInfinity;
};

bool contains(const Interval& outer, const Interval& inner) {
    return outer.low < inner.low && inner.high < outer.high;
}

// What each slab sees: intervals that overlap by some layers of points.
std::vector<Interval> cut(const Points& points, Eigen::Index axis, std::size_t slabs) {
    std::vector<double> along;
    along.reserve(points.size());
    for (const Vec3& p : points) {
        along.push_back(p[axis]);
    }
    const auto of_rank = [&](std::size_t rank) {
        const auto place = along.begin() + static_cast<std::ptrdiff_t>(rank);
        std::nth_element(along.begin(), place, along.end());
        return *place;
    };
    const std::size_t n = points.size();
    const std::size_t layers = points_in_layers(n);
    std::vector<Interval> seen(slabs);
    for (std::size_t i = 1; i < slabs; ++i) {
        const std::size_t rank = i * n / slabs;
        seen[i - 1].high = of_rank(std::min(rank + layers, n - 1));
        seen[i].low = of_rank(rank - std::min(layers, rank));
    }
    return seen;
}

// Of a tet's circumsphere along an axis, rather too long; unbounded where it can't be told.
Interval sphere_extent(const Points& points, const Tet& tet, Eigen::Index axis) {
    constexpr double kFlat = 1e-6;
    constexpr double kMargin = 1e-6;  // Of the radius: a thousand times the rounding error.
    const Vec3& a = points[at(tet[0])];
    const Vec3 u = points[at(tet[1])] - a;
    const Vec3 v = points[at(tet[2])] - a;
    const Vec3 w = points[at(tet[3])] - a;
    const Vec3 vw = v.cross(w);
    const double uu = u.squaredNorm();
    const double vv = v.squaredNorm();
    const double ww = w.squaredNorm();
    const double volume = u.dot(vw);
    if (!(volume > kFlat * std::sqrt(uu * vv * ww))) {
        return {};
    }
    const Vec3 center = (uu * vw + vv * w.cross(u) + ww * u.cross(v)) / (2.0 * volume);
    const double radius = center.norm() * (1.0 + kMargin) + 1e-14 * std::abs(a[axis]);
    return {a[axis] + center[axis] - radius, a[axis] + center[axis] + radius};
}

// The tets a slab answers for: those that it and no slab before it can vouch for.
TetComplex solve(const Points& points, Eigen::Index axis, const std::vector<Interval>& seen,
                 std::size_t slab) {
    std::vector<Index> members;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i][axis] >= seen[slab].low && points[i][axis] <= seen[slab].high) {
            members.push_back(static_cast<Index>(i));
        }
    }
    const TetComplex all = renumbered(delaunay_cells(selected(points, members)), members);

    std::vector<Index> id(all.tets.size(), kNone);
    TetComplex kept;
    for (std::size_t t = 0; t < all.tets.size(); ++t) {
        const Interval extent = sphere_extent(points, all.tets[t], axis);
        const auto vouches = [&](const Interval& interval) { return contains(interval, extent); };
        const auto mine = seen.begin() + static_cast<std::ptrdiff_t>(slab);
        if (vouches(*mine) && std::none_of(seen.begin(), mine, vouches)) {
            id[t] = static_cast<Index>(kept.tets.size());
            kept.tets.push_back(all.tets[t]);
        }
    }
    kept.neighbours.reserve(kept.tets.size());
    for (std::size_t t = 0; t < all.tets.size(); ++t) {
        if (id[t] != kNone) {
            auto& neighbours = kept.neighbours.emplace_back(all.neighbours[t]);
            for (Index& n : neighbours) {
                n = n == kNone ? kNone : id[at(n)];
            }
        }
    }
    return kept;
}

void append(TetComplex& to, const TetComplex& piece) {
    const auto offset = static_cast<Index>(to.tets.size());
    to.tets.insert(to.tets.end(), piece.tets.begin(), piece.tets.end());
    for (auto neighbours : piece.neighbours) {
        for (Index& n : neighbours) {
            n = n == kNone ? kNone : n + offset;
        }
        to.neighbours.push_back(neighbours);
    }
}

}  // namespace

std::size_t worthwhile_slabs(std::size_t points) {
    const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
    // What slabs see twice is to stay a small part.
    const std::size_t most =
        std::min(points / kLeastPoints, points / (6 * points_in_layers(points)));
    return std::clamp<std::size_t>(most, 1, threads);
}

TetComplex delaunay_in_slabs(const Points& points, std::size_t slabs, const RunContext& run) {
    Box box;
    for (const Vec3& p : points) {
        box.include(p);
    }
    Eigen::Index axis = 0;
    (box.high - box.low).maxCoeff(&axis);
    const std::vector<Interval> seen = cut(points, axis, slabs);
    std::vector<TetComplex> pieces(slabs);
    tbb::parallel_for(std::size_t{0}, slabs, [&](std::size_t slab) {
        run.checkpoint();
        pieces[slab] = solve(points, axis, seen, slab);
    });

    TetComplex complex;
    for (TetComplex& piece : pieces) {
        append(complex, piece);
        piece = {};
    }
    complete(complex, sew(complex), points, delaunay_cells, run);
    return complex;
}

}  // namespace remesh
