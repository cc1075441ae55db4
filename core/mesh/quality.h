#pragma once

#include <cmath>

#include "core/mesh/mesh.h"

namespace remesh {

// One contract for every measure: 1 best, 0 degenerate, < 0 inverted, scale-free.

/// Signed volume of a tet, model units cubed; positive when positively oriented.
[[nodiscard]] double tet_volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

/// q = 3 r_in / r_circ of a tet, the paper's normalised radii ratio; negative when inverted.
[[nodiscard]] inline double tet_radius_ratio(const Vec3& a, const Vec3& b, const Vec3& c,
                                             const Vec3& d) {
    const Vec3 u = b - a;
    const Vec3 v = c - a;
    const Vec3 w = d - a;
    const Vec3 vw = v.cross(w);
    const Vec3 wu = w.cross(u);
    const Vec3 uv = u.cross(v);
    const double six_volumes = u.dot(vw);
    const double twice_area = vw.norm() + wu.norm() + uv.norm() + (vw + wu + uv).norm();
    const double twelve_volumes_radius =
        (vw * u.squaredNorm() + wu * v.squaredNorm() + uv * w.squaredNorm()).norm();
    // r_in = 6V / (2A) and r_circ = (12 V R) / (2 * 6V).
    const double scale = twice_area * twelve_volumes_radius;
    return scale > 0.0 ? 6.0 * six_volumes * std::abs(six_volumes) / scale : 0.0;
}

/// s = 2 r_in / r_circ of a triangle.
[[nodiscard]] double triangle_radius_ratio(const Vec3& a, const Vec3& b, const Vec3& c);

/// Smallest and largest of some angles, radians.
struct AngleRange {
    double min = 0.0;
    double max = 0.0;
};

/// Of the six dihedral angles of a tet, radians. Regular: acos(1/3) = 70.53 degrees.
[[nodiscard]] AngleRange dihedral_angles(const Vec3& a, const Vec3& b, const Vec3& c,
                                         const Vec3& d);

/// Of the three angles of a triangle, radians.
[[nodiscard]] AngleRange triangle_angles(const Vec3& a, const Vec3& b, const Vec3& c);

/// Enclosed volume of a closed surface by the divergence theorem, model units cubed.
[[nodiscard]] double enclosed_volume(const SurfaceMesh& surface);

/// Sum of all triangle areas, model units squared.
[[nodiscard]] double surface_area(const SurfaceMesh& surface);

}  // namespace remesh
