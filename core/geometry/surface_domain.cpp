#include "core/geometry/surface_domain.h"

#include <cmath>
#include <limits>
#include <utility>

#include "core/error.h"

namespace remesh {

SurfaceDomain::SurfaceDomain(SurfaceMesh skin, Points normals)
    : skin_(std::move(skin)),
      vertex_normals_(std::move(normals)),
      bvh_(skin_.vertices, skin_.triangles),
      winding_(skin_.vertices, skin_.triangles) {
    facet_normals_.reserve(skin_.triangles.size());
    for (const auto& t : skin_.triangles) {
        const Vec3& a = skin_.vertices[static_cast<std::size_t>(t[0])];
        const Vec3& b = skin_.vertices[static_cast<std::size_t>(t[1])];
        const Vec3& c = skin_.vertices[static_cast<std::size_t>(t[2])];
        facet_normals_.push_back((b - a).cross(c - a).normalized());
        bounds_.include(a);
        bounds_.include(b);
        bounds_.include(c);
    }
}

int SurfaceDomain::region_at(const Vec3& point) const {
    const bool in_box = (point.array() >= bounds_.low.array()).all() &&
                        (point.array() <= bounds_.high.array()).all();
    return in_box && winding_.at(point) >= 0.5 ? 1 : 0;
}

BoundaryPoint SurfaceDomain::closest(const Vec3& point, Index hint) const {
    const auto nearest = bvh_.closest(point, std::numeric_limits<double>::infinity(), hint);
    if (!nearest) {
        // Options that are valid each by itself may still make the relaxation diverge.
        throw Error(ErrorCode::Unmeshable,
                    "a point went to infinity; options nearer to their defaults may help");
    }
    return boundary_point(*nearest);
}

std::optional<BoundaryPoint> SurfaceDomain::closest_within(const Vec3& point, double radius,
                                                           Index hint) const {
    const auto nearest = bvh_.closest(point, radius * radius, hint);
    if (!nearest) {
        return std::nullopt;
    }
    return boundary_point(*nearest);
}

std::optional<double> SurfaceDomain::first_hit(const Vec3& origin, const Vec3& direction,
                                               double t_min, double t_max, const Vec3& against,
                                               double max_cosine) const {
    const auto hit = bvh_.first_hit(origin, direction, t_min, t_max, [&](double t, Index facet) {
        return normal_at(facet, origin + t * direction).dot(against) < max_cosine;
    });
    if (!hit) {
        return std::nullopt;
    }
    return hit->t;
}

Vec3 SurfaceDomain::normal_at(Index facet, const Vec3& point) const {
    const auto f = static_cast<std::size_t>(facet);
    if (vertex_normals_.empty()) {
        return facet_normals_[f];
    }
    const auto& t = skin_.triangles[f];
    const auto vertex = [&](std::size_t k) -> const Vec3& {
        return skin_.vertices[static_cast<std::size_t>(t[k])];
    };
    const auto normal = [&](std::size_t k) -> const Vec3& {
        return vertex_normals_[static_cast<std::size_t>(t[k])];
    };
    const Vec3 n = (vertex(1) - vertex(0)).cross(vertex(2) - vertex(0));
    const double u = (vertex(2) - vertex(1)).cross(point - vertex(1)).dot(n);
    const double v = (vertex(0) - vertex(2)).cross(point - vertex(2)).dot(n);
    const Vec3 sum = u * normal(0) + v * normal(1) + (n.squaredNorm() - u - v) * normal(2);
    const double length = sum.norm();
    return length > 0.0 ? Vec3(sum / length) : facet_normals_[f];
}

BoundaryPoint SurfaceDomain::boundary_point(const Bvh::Nearest& nearest) const {
    return {.point = nearest.point,
            .normal = normal_at(nearest.triangle, nearest.point),
            .facet = nearest.triangle,
            .distance = std::sqrt(nearest.distance2)};
}

}  // namespace remesh
