#include "core/stages/sizing/curvature.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/geometry/edge_table.h"
#include "core/geometry/neighbour_grid.h"
#include "core/mesh/index.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kFitRadius = 4.0;     // Over the spacing: 2 is useless on stairs.
constexpr double kWideRadius = 8.0;    // Where the surface is so flat that this is allowed:
constexpr double kRadiusOverK = 0.35;  // at most this over the curvature.
constexpr double kMedianRadius = 2.0;  // Over the spacing.
constexpr double kOtherSide = -0.3;    // Cosine of normals on two sides of a thin sheet.
constexpr double kSharp = 40.0;        // Degrees.
constexpr std::size_t kFewest = 8;     // Points for a quadric of 6 coefficients.
constexpr double kRegularity = 1e-6;   // Of the sum of weights, added to the diagonal.
constexpr double kWorthWidening = 1.15;

Points normals_of(const SurfaceMesh& surface) {
    Points normals;
    normals.reserve(surface.triangles.size());
    for (const Triangle& t : surface.triangles) {
        const Vec3& a = surface.vertices[at(t[0])];
        const Vec3& b = surface.vertices[at(t[1])];
        const Vec3& c = surface.vertices[at(t[2])];
        normals.push_back((b - a).cross(c - a).normalized());
    }
    return normals;
}

// Triangles that are reached from each other without crossing a sharp edge.
std::vector<Index> smooth_patches(const SurfaceMesh& surface, const Points& normals) {
    const double flattest = std::cos(kSharp * std::numbers::pi / 180.0);
    const EdgeTable table(surface.triangles, surface.vertices.size());
    DisjointSets sets(surface.triangles.size());
    for (const EdgeTable::Edge& edge : table.edges()) {
        const auto sides = table.half_edges(edge);
        for (std::size_t k = 1; k < sides.size(); ++k) {
            const std::size_t a = EdgeTable::triangle_of(sides[k - 1]);
            const std::size_t b = EdgeTable::triangle_of(sides[k]);
            if (normals[a].dot(normals[b]) > flattest) {
                sets.merge(static_cast<Index>(a), static_cast<Index>(b));
            }
        }
    }
    std::vector<Index> patch(surface.triangles.size());
    for (std::size_t t = 0; t < patch.size(); ++t) {
        patch[t] = sets.find(static_cast<Index>(t));
    }
    return patch;
}

// Probes as a cloud of points with normals, asked for the neighbours on the same sheet.
class Cloud {
public:
    Cloud(const SurfaceMesh& surface, const std::vector<Probe>& probes, double reach,
          bool keep_apart)
        : probes_(probes), facet_normals_(normals_of(surface)), grid_(make_grid(probes, reach)) {
        if (keep_apart) {
            patch_ = smooth_patches(surface, facet_normals_);
        }
        reach_ = reach;
    }

    [[nodiscard]] const Vec3& normal(std::size_t k) const {
        return facet_normals_[at(probes_[k].facet)];
    }
    [[nodiscard]] const Vec3& point(std::size_t k) const { return probes_[k].x; }

    // Calls found(j, squared distance) for the points within `radius` <= reach of point k on its
    // sheet, itself included.
    template <typename Found>
    void visit(std::size_t k, double radius, Found found) const {
        // The grid looks within reach (h + 1) / 2.
        const double h = 2.0 * radius / reach_ - 1.0;
        grid_.visit(point(k), h, [&](Index j, double squared) {
            const bool is_apart =
                !patch_.empty() && patch_[at(probes_[at(j)].facet)] != patch_[at(probes_[k].facet)];
            if (!is_apart && normal(at(j)).dot(normal(k)) > kOtherSide) {
                found(at(j), squared);
            }
        });
    }

private:
    static NeighbourGrid make_grid(const std::vector<Probe>& probes, double reach) {
        Points points;
        for (const Probe& probe : probes) {
            points.push_back(probe.x);
        }
        std::vector<Index> all(points.size());
        std::iota(all.begin(), all.end(), 0);
        return {points, std::vector<double>(points.size(), 1.0), all, reach};
    }

    const std::vector<Probe>& probes_;
    Points facet_normals_;
    NeighbourGrid grid_;
    std::vector<Index> patch_{};  // By facet; empty: all are one.
    double reach_ = 0.0;
};

// |H| + sqrt(H^2 - K) of the height function a u^2 / 2 + b u v + c v^2 / 2 + d u + e v + f at 0.
double larger_curvature(const Eigen::Matrix<double, 6, 1>& s, double scale) {
    const double fu = s[3];
    const double fv = s[4];
    const double w2 = 1.0 + fu * fu + fv * fv;
    const double w = std::sqrt(w2);
    const double l = s[0] / scale / w;
    const double m = s[1] / scale / w;
    const double n = s[2] / scale / w;
    const double gauss = (l * n - m * m) / w2;
    const double mean =
        ((1.0 + fu * fu) * n - 2.0 * fu * fv * m + (1.0 + fv * fv) * l) / (2.0 * w2);
    return std::abs(mean) + std::sqrt(std::max(0.0, mean * mean - gauss));
}

double fit_curvature(const Cloud& cloud, std::size_t k, double radius) {
    const Vec3& x = cloud.point(k);
    const auto weight = [&](double squared) {
        return std::exp(-2.0 * squared / (radius * radius));
    };
    Vec3 sum = Vec3::Zero();
    std::size_t count = 0;
    cloud.visit(k, radius, [&](std::size_t j, double squared) {
        sum += weight(squared) * cloud.normal(j);
        ++count;
    });
    if (count < kFewest || !(sum.norm() > 0.0)) {
        return 0.0;
    }
    const Vec3 n = sum.normalized();
    const Vec3 u = n.unitOrthogonal();
    const Vec3 v = n.cross(u);
    Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
    double weights = 0.0;
    cloud.visit(k, radius, [&](std::size_t j, double squared) {
        const Vec3 d = (cloud.point(j) - x) / radius;
        const double p = d.dot(u);
        const double q = d.dot(v);
        Eigen::Matrix<double, 6, 1> row;
        row << 0.5 * p * p, p * q, 0.5 * q * q, p, q, 1.0;
        const double w = weight(squared);
        a.noalias() += w * row * row.transpose();
        b += (w * d.dot(n)) * row;
        weights += w;
    });
    a.diagonal().array() += kRegularity * weights;
    return larger_curvature(a.ldlt().solve(b), radius);
}

}  // namespace

std::vector<double> estimate_curvature(const SurfaceMesh& surface, const std::vector<Probe>& probes,
                                       double spacing, bool keep_apart, RunContext& run) {
    const double widest = kWideRadius * spacing;
    const Cloud cloud(surface, probes, widest, keep_apart);
    std::vector<double> curvature(probes.size());
    for_each_index(probes.size(), run, [&](std::size_t k) {
        const double narrow = kFitRadius * spacing;
        curvature[k] = fit_curvature(cloud, k, narrow);
        // Flatter places bear a wider fit, which sees less noise.
        const double wide = std::min(widest, kRadiusOverK / std::max(curvature[k], 1e-300));
        if (wide > kWorthWidening * narrow) {
            curvature[k] = fit_curvature(cloud, k, wide);
        }
    });
    return curvature;
}

std::vector<double> median_nearby(const SurfaceMesh& surface, const std::vector<Probe>& probes,
                                  const std::vector<double>& values, double spacing,
                                  bool keep_apart, RunContext& run) {
    const Cloud cloud(surface, probes, kMedianRadius * spacing, keep_apart);
    std::vector<double> medians(probes.size());
    for_each_block(probes.size(), kGrain, run, [&](std::size_t begin, std::size_t end) {
        std::vector<double> around;
        for (std::size_t k = begin; k < end; ++k) {
            around.clear();
            cloud.visit(k, kMedianRadius * spacing,
                        [&](std::size_t j, double) { around.push_back(values[j]); });
            const auto middle = around.begin() + static_cast<std::ptrdiff_t>(around.size() / 2);
            std::nth_element(around.begin(), middle, around.end());
            medians[k] = around.empty() ? values[k] : *middle;
        }
    });
    return medians;
}

}  // namespace remesh
