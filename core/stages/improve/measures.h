#pragma once

#include <algorithm>
#include <cmath>

#include "core/mesh/quality.h"

// Measures for the inner loops, all with one contract: the regular element's value is best, 0 is
// degenerate, < 0 inverted; scale-free.
namespace remesh::improve {

/// Sine of the dihedral angle farthest from 90 degrees; negative when inverted.
inline double dihedral_sine(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    const Vec3 u = b - a;
    const Vec3 v = c - a;
    const Vec3 w = d - a;
    const Vec3 vw = v.cross(w);
    const Vec3 wu = w.cross(u);
    const Vec3 uv = u.cross(v);
    const double volume = u.dot(vw);
    const double n1 = vw.squaredNorm();
    const double n2 = wu.squaredNorm();
    const double n3 = uv.squaredNorm();
    const double n0 = (vw + wu + uv).squaredNorm();
    const double product = n0 * n1 * n2 * n3;
    if (!(product > 0.0)) {
        return 0.0;
    }
    // sin = volume6 * edge / (product of the normals of both faces at the edge); each quotient is
    // written over the common denominator to divide once.
    const double least =
        std::min({u.squaredNorm() * n0 * n1, v.squaredNorm() * n0 * n2, w.squaredNorm() * n0 * n3,
                  (v - u).squaredNorm() * n1 * n2, (w - u).squaredNorm() * n1 * n3,
                  (w - v).squaredNorm() * n2 * n3});
    return volume * std::sqrt(least / product);
}

/// Sine of the smallest angle of a triangle, in [0, sin 60 degrees].
inline double angle_sine(const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 u = b - a;
    const Vec3 v = c - a;
    const double area2 = u.cross(v).squaredNorm();
    const double ab = u.squaredNorm();
    const double ac = v.squaredNorm();
    const double bc = (v - u).squaredNorm();
    const double shortest = std::min({ab, ac, bc});
    const double product = ab * ac * bc;
    return product > 0.0 ? std::sqrt(area2 * shortest / product) : 0.0;
}

/// Angles of boundary triangles are compared with dihedral angles through this factor: 38 degrees
/// of the one are as good as 27 of the other.
inline constexpr double kTriangleScale = 0.737;

inline double angle_degrees(double sine) {
    return std::asin(std::clamp(sine, -1.0, 1.0)) * (180.0 / 3.14159265358979323846);
}

/// What flips compare while the mean still matters.
struct RadiusRatio {
    static double of(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
        return tet_radius_ratio(a, b, c, d);
    }
};

/// What the worst elements are judged by.
struct DihedralSine {
    static double of(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
        return dihedral_sine(a, b, c, d);
    }
};

}  // namespace remesh::improve
