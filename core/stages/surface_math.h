#pragma once

#include <cstdint>
#include <string>

#include "core/mesh/mesh.h"

namespace remesh {

/// Corner k of triangle i.
[[nodiscard]] inline const Vec3& corner(const SurfaceMesh& surface, std::size_t i, std::size_t k) {
    return surface.vertices[static_cast<std::size_t>(surface.triangles[i][k])];
}

/// Normal of triangle i, as long as its area.
[[nodiscard]] inline Vec3 area_vector(const SurfaceMesh& surface, std::size_t i) {
    const Vec3& a = corner(surface, i, 0);
    return 0.5 * (corner(surface, i, 1) - a).cross(corner(surface, i, 2) - a);
}

[[nodiscard]] inline Vec3 centroid(const SurfaceMesh& surface, std::size_t i) {
    return (corner(surface, i, 0) + corner(surface, i, 1) + corner(surface, i, 2)) / 3.0;
}

/// Area-weighted middle of the triangles listed.
template <typename Indices>
[[nodiscard]] Vec3 center_of_area(const SurfaceMesh& surface, const Indices& triangles) {
    Vec3 moment = Vec3::Zero();
    double area = 0.0;
    for (const auto i : triangles) {
        const double a = area_vector(surface, static_cast<std::size_t>(i)).norm();
        moment += a * centroid(surface, static_cast<std::size_t>(i));
        area += a;
    }
    return moment / area;
}

/// Signed volume of the tet of triangle i and `apex`.
[[nodiscard]] inline double cone_volume(const SurfaceMesh& surface, std::size_t i,
                                        const Vec3& apex) {
    return area_vector(surface, i).dot(corner(surface, i, 0) - apex) / 3.0;
}

/// "1 triangle", "2 triangles".
[[nodiscard]] inline std::string count_of(std::int64_t n, const std::string& noun) {
    return std::to_string(n) + " " + noun + (n == 1 ? "" : "s");
}

}  // namespace remesh
