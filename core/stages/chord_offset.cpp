#include "core/stages/chord_offset.h"

#include <algorithm>
#include <cmath>

#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr double kRadius = 0.5;    // Of h: curvature is averaged over about so much.
constexpr int kMostRounds = 30;    // Of averaging.
constexpr double kGuarded = 1.4;   // Edges aren't longer than this times a rod's radius,
constexpr double kShortest = 0.5;  // but at least this times h.

/// Integral of the divergence of the normals over triangle i: of twice the mean curvature.
double total_divergence(const SurfaceMesh& surface, const Points& normals, std::size_t i) {
    const Vec3 normal = area_vector(surface, i).normalized();
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3 opposite = corner(surface, i, (k + 2) % 3) - corner(surface, i, (k + 1) % 3);
        const auto v = static_cast<std::size_t>(surface.triangles[i][k]);
        sum += 0.5 * normals[v].dot(normal.cross(opposite));
    }
    return sum;
}

double mean_edge(const SurfaceMesh& surface) {
    double sum = 0.0;
    for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
        sum += (corner(surface, i, 1) - corner(surface, i, 0)).norm();
    }
    return sum / static_cast<double>(surface.triangles.size());
}

}  // namespace

std::vector<double> chord_offsets(const SurfaceMesh& surface, const Points& normals, double h) {
    const std::size_t n = surface.triangles.size();
    std::vector<double> area(n);
    std::vector<double> weight(surface.vertices.size(), 0.0);
    std::vector<double> curvature(surface.vertices.size(), 0.0);  // Twice the mean one.
    if (n == 0) {
        return curvature;
    }
    for (std::size_t i = 0; i < n; ++i) {
        area[i] = area_vector(surface, i).norm();
        const double divergence = area[i] > 0.0 ? total_divergence(surface, normals, i) : 0.0;
        for (const Index v : surface.triangles[i]) {
            weight[static_cast<std::size_t>(v)] += area[i];
            curvature[static_cast<std::size_t>(v)] += divergence;
        }
    }
    const auto divide = [&](std::vector<double>& values) {
        for (std::size_t v = 0; v < values.size(); ++v) {
            values[v] = weight[v] > 0.0 ? values[v] / weight[v] : 0.0;
        }
    };
    divide(curvature);
    // Each round averages over about an edge length.
    const double reach = kRadius * h / mean_edge(surface);
    const int rounds = std::clamp(static_cast<int>(std::ceil(reach * reach)), 1, kMostRounds);
    std::vector<double> next;
    for (int round = 0; round < rounds; ++round) {
        next.assign(curvature.size(), 0.0);
        for (std::size_t i = 0; i < n; ++i) {
            double mean = 0.0;
            for (const Index v : surface.triangles[i]) {
                mean += curvature[static_cast<std::size_t>(v)] / 3.0;
            }
            for (const Index v : surface.triangles[i]) {
                next[static_cast<std::size_t>(v)] += area[i] * mean;
            }
        }
        divide(next);
        curvature.swap(next);
    }
    for (double& value : curvature) {
        const double edge =
            std::clamp(kGuarded / std::max(std::abs(value), 1e-30), kShortest * h, h);
        value = std::clamp(value * edge * edge / 16.0, -0.1 * h, 0.1 * h);
    }
    return curvature;
}

}  // namespace remesh
