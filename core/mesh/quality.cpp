#include "core/mesh/quality.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace remesh {
namespace {

double angle_between(const Vec3& u, const Vec3& v) {
    return std::atan2(u.cross(v).norm(), u.dot(v));
}

}  // namespace

double tet_volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    return (b - a).dot((c - a).cross(d - a)) / 6.0;
}

double triangle_radius_ratio(const Vec3& a, const Vec3& b, const Vec3& c) {
    const double la = (b - c).norm();
    const double lb = (c - a).norm();
    const double lc = (a - b).norm();
    const double area = 0.5 * (b - a).cross(c - a).norm();
    const double scale = (la + lb + lc) * la * lb * lc;
    // r_in = 2A / (la + lb + lc) and r_circ = la lb lc / (4A).
    return scale > 0.0 ? 16.0 * area * area / scale : 0.0;
}

AngleRange dihedral_angles(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    const std::array<Vec3, 4> normals{(d - b).cross(c - b), (c - a).cross(d - a),
                                      (d - a).cross(b - a), (b - a).cross(c - a)};
    AngleRange range{.min = std::numbers::pi, .max = 0.0};
    for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t j = i + 1; j < 4; ++j) {
            const double angle = std::numbers::pi - angle_between(normals[i], normals[j]);
            range.min = std::min(range.min, angle);
            range.max = std::max(range.max, angle);
        }
    }
    return range;
}

AngleRange triangle_angles(const Vec3& a, const Vec3& b, const Vec3& c) {
    const std::array<double, 3> angles{angle_between(b - a, c - a), angle_between(c - b, a - b),
                                       angle_between(a - c, b - c)};
    return {.min = *std::min_element(angles.begin(), angles.end()),
            .max = *std::max_element(angles.begin(), angles.end())};
}

double enclosed_volume(const SurfaceMesh& surface) {
    if (surface.vertices.empty()) {
        return 0.0;
    }
    const Vec3 origin =
        bounding_box(surface.vertices).low;  // Near the mesh: far coordinates lose digits.
    double sum = 0.0;
    for (const auto& [a, b, c] : surface.triangles) {
        sum += (surface.vertices[static_cast<std::size_t>(a)] - origin)
                   .dot((surface.vertices[static_cast<std::size_t>(b)] - origin)
                            .cross(surface.vertices[static_cast<std::size_t>(c)] - origin));
    }
    return sum / 6.0;
}

double surface_area(const SurfaceMesh& surface) {
    double sum = 0.0;
    for (const auto& [a, b, c] : surface.triangles) {
        const Vec3& origin = surface.vertices[static_cast<std::size_t>(a)];
        sum += (surface.vertices[static_cast<std::size_t>(b)] - origin)
                   .cross(surface.vertices[static_cast<std::size_t>(c)] - origin)
                   .norm();
    }
    return 0.5 * sum;
}

}  // namespace remesh
