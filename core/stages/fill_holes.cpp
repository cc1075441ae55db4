#include "core/stages/fill_holes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <compare>
#include <limits>
#include <utility>
#include <vector>

#include "core/geometry/bvh.h"
#include "core/geometry/edge_table.h"
#include "core/geometry/spline_surface.h"
#include "core/stages/march_level.h"
#include "core/stages/rims.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr double kLeastRadius = 1.5;  // Of h: narrower holes can't sag.
constexpr double kProbe = 0.25;       // Of the radius: where it's looked whether a hole is open,
constexpr double kLeastOpen = 0.1;    // and how far w must be from 0 and 1 there.
constexpr double kReach = 0.6;        // Of the radius: how much of the surface around is taken,
constexpr double kLeastReach = 3.0;   // but at least so many mean edges of the rim.
constexpr std::size_t kMostPoints = 128;
constexpr double kOneDirection = 0.7;  // |Sum of area vectors| over the area of a usable sample.
constexpr double kRoughness = 1e-3;    // The spline's smoothness where points are noisy.
constexpr double kCell = 0.6;          // Of h: cells of the grid, or coarser in a very wide hole:
constexpr double kCellsAcross = 40.0;  // so many to a radius.
constexpr double kGap = 0.25;          // Of h: patches stop so near to the surface,
constexpr double kRoughGap = 0.5;      // and where it's rough.
constexpr double kFarGap = 1.0;        // Of h: likewise over triangles that aren't on a rim.
constexpr double kBulge = 0.5;         // Of the radius: how far a patch may leave the rim's box.
constexpr double kBoundW = 0.02;       // w of the open surface lies within 0 and 1 by this
constexpr double kBoundShare = 0.9;    // on so much of a patch that can be right.

/// A hole, or the gap between two ends of a tube.
struct Opening {
    std::vector<const Rim*> rims{};
    double radius = 0.0;
    double length = 0.0;
};

class SplineLevel : public LevelField {
public:
    explicit SplineLevel(const SplineSurface& spline) : spline_(spline) {}

    [[nodiscard]] double depth(const Vec3& point) const override { return -spline_.at(point); }

private:
    const SplineSurface& spline_;
};

class Filler {
public:
    Filler(const SurfaceMesh& surface, const WindingNumber& winding, const FillOptions& options,
           RunContext& run)
        : surface_(surface),
          winding_(winding),
          options_(options),
          run_(run),
          table_(surface.triangles, surface.vertices.size()),
          rims_(find_rims(surface, table_)) {}

    FillResult fill() {
        const auto openings = find_openings();
        if (openings.empty()) {
            return {};
        }
        bvh_ = Bvh(surface_.vertices, surface_.triangles);
        mark_rims();
        double longest = 0.0;
        for (const Opening& opening : openings) {
            run_.checkpoint();
            if (fill(opening) && opening.length > longest) {
                longest = opening.length;
                result_.largest = opening.rims.front()->center;
            }
        }
        return std::move(result_);
    }

private:
    void mark_rims() {
        std::vector<char> is_rim_vertex(surface_.vertices.size(), 0);
        for (const auto& edge : table_.edges()) {
            if (edge.count == 1) {
                is_rim_vertex[static_cast<std::size_t>(edge.low)] = 1;
                is_rim_vertex[static_cast<std::size_t>(edge.high)] = 1;
            }
        }
        on_rim_.resize(surface_.triangles.size());
        for (std::size_t i = 0; i < on_rim_.size(); ++i) {
            const Triangle& t = surface_.triangles[i];
            on_rim_[i] = std::any_of(t.begin(), t.end(), [&](Index v) {
                return is_rim_vertex[static_cast<std::size_t>(v)] != 0;
            });
        }
    }

    [[nodiscard]] std::vector<Opening> find_openings() const {
        std::vector<Opening> openings;
        std::vector<const Rim*> ends;
        for (const Rim& rim : rims_) {
            if (rim.radius < kLeastRadius * options_.h || !is_open(rim)) {
                continue;
            }
            if (rim.is_hole()) {
                openings.push_back({.rims = {&rim}, .radius = rim.radius, .length = rim.length});
            } else if (rim.is_tube_end()) {
                ends.push_back(&rim);
            }
        }
        pair_up(ends, openings);
        return openings;
    }

    /// Whether inside and outside meet beyond a rim: neither a seam nor a fin.
    [[nodiscard]] bool is_open(const Rim& rim) const {
        double sum = 0.0;
        for (const auto half : rim.edges) {
            const RimEdge edge = rim_edge(surface_, half);
            const double w = winding_.at(edge.middle + kProbe * rim.radius * edge.outward);
            sum += std::clamp(std::min(w, 1.0 - w), 0.0, 0.5);
        }
        return sum > kLeastOpen * static_cast<double>(rim.edges.size());
    }

    /// How well two ends face each other: their distance, or infinity if they don't.
    [[nodiscard]] double facing(const Rim& a, const Rim& b) const {
        constexpr double kInLine = 0.7;
        const Vec3 across = b.center - a.center;
        const double distance = across.norm();
        const bool ok = distance > options_.h && distance < 3.0 * (a.radius + b.radius) &&
                        std::max(a.radius, b.radius) < 2.0 * std::min(a.radius, b.radius) &&
                        a.outward.dot(across) > kInLine * a.outward.norm() * distance &&
                        b.outward.dot(across) < -kInLine * b.outward.norm() * distance;
        return ok ? distance : std::numeric_limits<double>::infinity();
    }

    void pair_up(const std::vector<const Rim*>& ends, std::vector<Opening>& openings) const {
        const auto best_of = [&](std::size_t i) {
            std::size_t best = i;
            double least = std::numeric_limits<double>::infinity();
            for (std::size_t k = 0; k < ends.size(); ++k) {
                const double distance = k == i ? least : facing(*ends[i], *ends[k]);
                if (distance < least) {
                    least = distance;
                    best = k;
                }
            }
            return best;
        };
        for (std::size_t i = 0; i < ends.size(); ++i) {
            const std::size_t k = best_of(i);
            if (i < k && best_of(k) == i) {
                openings.push_back({.rims = {ends[i], ends[k]},
                                    .radius = std::max(ends[i]->radius, ends[k]->radius),
                                    .length = ends[i]->length + ends[k]->length});
            }
        }
    }

    bool fill(const Opening& opening) {
        const auto spline = spline_around(opening);
        if (!spline) {
            return false;
        }
        Points seeds;
        Box bounds;
        for (const Rim* rim : opening.rims) {
            for (const auto half : rim->edges) {
                const RimEdge edge = rim_edge(surface_, half);
                seeds.push_back(edge.middle);
                bounds.include(edge.middle);
            }
        }
        const double margin = kBulge * opening.radius + 2.0 * options_.h;
        bounds.low -= Vec3::Constant(margin);
        bounds.high += Vec3::Constant(margin);
        const double cell = std::max(kCell * options_.h, opening.radius / kCellsAcross);
        const double scale = cell / kCell;
        const auto patch = march_level(SplineLevel(*spline), bvh_, on_rim_, seeds,
                                       {.origin = grid_origin(bounds, cell),
                                        .cell = cell,
                                        .gap = (options_.is_rough ? kRoughGap : kGap) * scale,
                                        .far_gap = kFarGap * scale,
                                        .bounds = bounds},
                                       run_);
        if (!patch || patch->triangles.empty() || !is_plausible(*patch)) {
            return false;
        }
        append(*patch);
        ++result_.filled;
        return true;
    }

    [[nodiscard]] std::optional<SplineSurface> spline_around(const Opening& opening) const {
        Points points;
        Points normals;
        for (const Rim* rim : opening.rims) {
            sample(collar_of(*rim), *rim, kMostPoints / opening.rims.size(), points, normals);
        }
        return SplineSurface::through(points, normals, options_.is_rough ? kRoughness : 0.0);
    }

    [[nodiscard]] double reach_of(const Rim& rim) const {
        const double edge = rim.length / static_cast<double>(rim.edges.size());
        return std::max(kReach * rim.radius, kLeastReach * edge);
    }

    /// Triangles within reach of the rim, along the surface.
    [[nodiscard]] std::vector<Index> collar_of(const Rim& rim) const {
        const double reach = reach_of(rim);
        std::vector<Index> collar;
        Points from;  // Where on the rim each was reached from.
        std::vector<char> seen(surface_.triangles.size(), 0);
        const auto visit = [&](std::size_t triangle, const Vec3& origin) {
            if (!seen[triangle] && (centroid(surface_, triangle) - origin).norm() < reach) {
                seen[triangle] = 1;
                collar.push_back(static_cast<Index>(triangle));
                from.push_back(origin);
            }
        };
        for (const auto half : rim.edges) {
            visit(EdgeTable::triangle_of(half), rim_edge(surface_, half).middle);
        }
        for (std::size_t q = 0; q < collar.size(); ++q) {
            const EdgeTable::HalfEdge first = 3 * collar[q];
            for (EdgeTable::HalfEdge half = first; half != first + 3; ++half) {
                const auto& edge = table_.edge_of(half);
                for (const auto other : table_.half_edges(edge)) {
                    visit(EdgeTable::triangle_of(other), Vec3(from[q]));
                }
            }
        }
        return collar;
    }

    /// Mean points and normals of the triangles in each cell of a grid, at most `most`.
    void sample(const std::vector<Index>& triangles, const Rim& rim, std::size_t most,
                Points& points, Points& normals) const {
        struct Item {
            std::array<std::int64_t, 3> cell;
            Index triangle;
            auto operator<=>(const Item&) const = default;
        };
        std::vector<Item> items(triangles.size());
        for (double size = reach_of(rim) / 4.0;; size *= 1.2) {
            std::size_t cells = 0;
            for (std::size_t i = 0; i < items.size(); ++i) {
                const Vec3 x =
                    (centroid(surface_, static_cast<std::size_t>(triangles[i])) - rim.center) /
                    size;
                items[i].triangle = triangles[i];
                for (std::size_t d = 0; d < 3; ++d) {
                    items[i].cell[d] =
                        static_cast<std::int64_t>(std::floor(x[static_cast<Eigen::Index>(d)]));
                }
            }
            std::sort(items.begin(), items.end());
            for (std::size_t i = 0; i < items.size(); ++i) {
                cells += i == 0 || items[i].cell != items[i - 1].cell;
            }
            if (cells <= most) {
                break;
            }
        }
        for (std::size_t i = 0; i < items.size();) {
            Vec3 moment = Vec3::Zero();
            Vec3 normal = Vec3::Zero();
            double area = 0.0;
            const auto cell = items[i].cell;
            for (; i < items.size() && items[i].cell == cell; ++i) {
                const auto t = static_cast<std::size_t>(items[i].triangle);
                const Vec3 a = area_vector(surface_, t);
                moment += a.norm() * centroid(surface_, t);
                normal += a;
                area += a.norm();
            }
            if (normal.norm() > kOneDirection * area) {
                points.push_back(moment / area);
                normals.push_back(normal.normalized());
            }
        }
    }

    /// Whether w lies between inside and outside on most of a patch, as it does where the surface
    /// is missing.
    [[nodiscard]] bool is_plausible(const SurfaceMesh& patch) const {
        const std::size_t step = std::max<std::size_t>(1, patch.triangles.size() / 500);
        std::size_t count = 0;
        std::size_t good = 0;
        for (std::size_t i = 0; i < patch.triangles.size(); i += step) {
            const double w = winding_.at(centroid(patch, i));
            ++count;
            good += w > kBoundW && w < 1.0 - kBoundW;
        }
        return static_cast<double>(good) >= kBoundShare * static_cast<double>(count);
    }

    void append(const SurfaceMesh& patch) {
        auto& all = result_.patches;
        const auto shift = static_cast<Index>(all.vertices.size());
        all.vertices.insert(all.vertices.end(), patch.vertices.begin(), patch.vertices.end());
        for (std::size_t i = 0; i < patch.triangles.size(); ++i) {
            const Triangle& t = patch.triangles[i];
            all.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
            result_.area += area_vector(patch, i).norm();
        }
    }

    const SurfaceMesh& surface_;
    const WindingNumber& winding_;
    const FillOptions& options_;
    RunContext& run_;
    EdgeTable table_;
    std::vector<Rim> rims_;
    Bvh bvh_;
    std::vector<char> on_rim_;  // #T: has a vertex on a rim.
    FillResult result_;
};

}  // namespace

FillResult fill_wide_holes(const SurfaceMesh& surface, const WindingNumber& winding,
                           const FillOptions& options, RunContext& run) {
    return Filler(surface, winding, options, run).fill();
}

}  // namespace remesh
