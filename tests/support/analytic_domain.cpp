#include "tests/support/analytic_domain.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/support/shapes.h"

namespace remesh::testing {
namespace {

std::size_t at(Index i) {
    return static_cast<std::size_t>(i);
}

SurfaceMesh scaled(const SurfaceMesh& mesh, const Vec3& factors, const Vec3& shift) {
    return transformed(mesh, factors.asDiagonal().toDenseMatrix(), shift);
}

// Whether a direction from the origin passes through the triangle a b c around the origin.
bool sees(const Vec3& direction, const Vec3& a, const Vec3& b, const Vec3& c) {
    return a.cross(b).dot(direction) >= 0 && b.cross(c).dot(direction) >= 0 &&
           c.cross(a).dot(direction) >= 0;
}

// Refined triangle t of `icosphere` becomes triangles 4t (at a), 4t+1 (at b), 4t+2 (at c), 4t+3.
Index locate_on_icosphere(const SurfaceMesh& coarse, int levels, const Vec3& direction) {
    for (std::size_t t = 0; t < coarse.triangles.size(); ++t) {
        Vec3 a = coarse.vertices[at(coarse.triangles[t][0])];
        Vec3 b = coarse.vertices[at(coarse.triangles[t][1])];
        Vec3 c = coarse.vertices[at(coarse.triangles[t][2])];
        if (!sees(direction, a, b, c)) {
            continue;
        }
        Index facet = static_cast<Index>(t);
        for (int level = 0; level < levels; ++level) {
            const Vec3 ab = (a + b).normalized();
            const Vec3 bc = (b + c).normalized();
            const Vec3 ca = (c + a).normalized();
            facet *= 4;
            if (ca.cross(ab).dot(direction) < 0) {
                b = ab;
                c = ca;
            } else if (ab.cross(bc).dot(direction) < 0) {
                facet += 1;
                a = b;
                b = bc;
                c = ab;
            } else if (bc.cross(ca).dot(direction) < 0) {
                facet += 2;
                a = c;
                b = ca;
                c = bc;
            } else {
                facet += 3;
                a = ab;
                b = bc;
                c = ca;
            }
        }
        return facet;
    }
    return 0;
}

}  // namespace

std::optional<BoundaryPoint> AnalyticDomain::closest_within(const Vec3& point, double radius,
                                                            Index hint) const {
    const BoundaryPoint found = closest(point, hint);
    return found.distance < radius ? std::optional(found) : std::nullopt;
}

std::optional<double> AnalyticDomain::first_hit(const Vec3& origin, const Vec3& direction,
                                                double t_min, double t_max, const Vec3& against,
                                                double max_cosine) const {
    constexpr double kClose = 1e-9;
    double t = t_min;
    while (t < t_max) {
        const BoundaryPoint near = closest(origin + t * direction);
        if (near.distance > kClose) {
            t += near.distance;
            continue;
        }
        if (near.normal.dot(against) < max_cosine) {
            return t;
        }
        t += 1e-3 * (t_max - t_min);
    }
    return std::nullopt;
}

SphereDomain::SphereDomain(double radius, Vec3 center, int levels)
    : AnalyticDomain(scaled(icosphere(levels), Vec3::Constant(radius), center)),
      radius_(radius),
      center_(std::move(center)),
      levels_(levels) {}

BoundaryPoint SphereDomain::closest(const Vec3& point, Index hint) const {
    static const SurfaceMesh kIcosahedron = icosphere(0);
    const Vec3 offset = point - center_;
    const double length = offset.norm();
    const Vec3 normal = length > 0.0 ? Vec3(offset / length) : Vec3::UnitX();
    const bool is_hint_right = [&] {
        if (hint == kNone) {
            return false;
        }
        const Triangle& t = boundary().triangles[at(hint)];
        const auto corner = [&](std::size_t i) {
            return Vec3(boundary().vertices[at(t[i])] - center_);
        };
        return sees(normal, corner(0), corner(1), corner(2));
    }();
    return {.point = center_ + radius_ * normal,
            .normal = normal,
            .facet = is_hint_right ? hint : locate_on_icosphere(kIcosahedron, levels_, normal),
            .distance = std::abs(length - radius_)};
}

double SphereDomain::signed_distance(const Vec3& point) const {
    return (point - center_).norm() - radius_;
}

TorusDomain::TorusDomain(double major, double minor, int around, int across)
    : AnalyticDomain(torus(major, minor, around, across)),
      major_(major),
      minor_(minor),
      around_(around),
      across_(across) {}

BoundaryPoint TorusDomain::closest(const Vec3& point, Index /*hint*/) const {
    const double rho = std::hypot(point.x(), point.y());
    const Vec3 radial = rho > 0.0 ? Vec3(point.x() / rho, point.y() / rho, 0.0) : Vec3::UnitX();
    const Vec3 ring = major_ * radial;
    const double length = (point - ring).norm();
    const Vec3 normal = length > 0.0 ? Vec3((point - ring) / length) : Vec3::UnitZ();

    const auto turns = [](double y, double x) {
        const double t = std::atan2(y, x) / (2.0 * std::numbers::pi);
        return t < 0.0 ? t + 1.0 : t;
    };
    const double u = turns(radial.y(), radial.x()) * around_;
    const double v = turns(normal.z(), normal.dot(radial)) * across_;
    const int i = std::min(static_cast<int>(u), around_ - 1);
    const int j = std::min(static_cast<int>(v), across_ - 1);
    return {.point = ring + minor_ * normal,
            .normal = normal,
            .facet = 2 * (i * across_ + j) + (u - i >= v - j ? 0 : 1),
            .distance = std::abs(length - minor_)};
}

double TorusDomain::signed_distance(const Vec3& point) const {
    return std::hypot(std::hypot(point.x(), point.y()) - major_, point.z()) - minor_;
}

BoxDomain::BoxDomain(const Vec3& size)
    : AnalyticDomain(scaled(unit_cube(), size, Vec3::Zero())), size_(size) {}

BoundaryPoint BoxDomain::closest(const Vec3& point, Index /*hint*/) const {
    BoundaryPoint found;
    found.point = point.cwiseMax(Vec3::Zero()).cwiseMin(size_);
    Eigen::Index axis = 0;
    bool is_high = false;
    if (found.point == point) {
        const double to_low = point.minCoeff(&axis);
        Eigen::Index high_axis = 0;
        const double to_high = (size_ - point).minCoeff(&high_axis);
        is_high = to_high < to_low;
        axis = is_high ? high_axis : axis;
        found.point[axis] = is_high ? size_[axis] : 0.0;
    } else {
        (point - found.point).cwiseAbs().maxCoeff(&axis);
        is_high = point[axis] > found.point[axis];
    }
    found.normal = (is_high ? 1.0 : -1.0) * Vec3::Unit(axis);
    found.distance = (point - found.point).norm();

    // Faces of `unit_cube` come as z, y, x, low before high, two triangles each.
    const Index first = static_cast<Index>(4 * (2 - axis) + (is_high ? 2 : 0));
    const Triangle& t = boundary().triangles[at(first)];
    const auto corner = [&](std::size_t i) { return Vec3(boundary().vertices[at(t[i])]); };
    const Vec3 diagonal = corner(2) - corner(0);
    const bool is_first = diagonal.cross(found.point - corner(0)).dot(found.normal) <= 0.0;
    found.facet = is_first ? first : first + 1;
    return found;
}

double BoxDomain::signed_distance(const Vec3& point) const {
    const Vec3 beyond = (point - 0.5 * size_).cwiseAbs() - 0.5 * size_;
    return beyond.cwiseMax(Vec3::Zero()).norm() + std::min(beyond.maxCoeff(), 0.0);
}

FeatureSet BoxDomain::features() const {
    FeatureSet set;
    set.corners = boundary().vertices;
    for (std::size_t i = 0; i < 8; ++i) {
        for (const std::size_t bit : {1u, 2u, 4u}) {
            if ((i & bit) == 0) {
                set.curves.push_back({.points = {set.corners[i], set.corners[i | bit]}});
            }
        }
    }
    return set;
}

}  // namespace remesh::testing
