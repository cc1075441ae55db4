#pragma once

#include <array>
#include <optional>

#include "core/geometry/domain.h"
#include "core/stages/features.h"

namespace remesh::testing {

/// A body known in closed form, so that stages can be tested without the triangle code.
/// `closest` answers on the true shape; `boundary()` is a triangle mesh inscribed in it.
class AnalyticDomain : public Domain {
public:
    [[nodiscard]] int region_at(const Vec3& point) const override {
        return signed_distance(point) < 0.0 ? 1 : 0;
    }
    [[nodiscard]] std::optional<BoundaryPoint> closest_within(const Vec3& point, double radius,
                                                              Index hint = kNone) const override;
    /// Walks along the ray in steps of the distance, so it is exact to about 1e-9.
    [[nodiscard]] std::optional<double> first_hit(const Vec3& origin, const Vec3& direction,
                                                  double t_min, double t_max, const Vec3& against,
                                                  double max_cosine) const override;
    [[nodiscard]] const SurfaceMesh& boundary() const override { return boundary_; }
    [[nodiscard]] Box bounds() const override { return bounding_box(boundary_.vertices); }

    /// Negative inside.
    [[nodiscard]] virtual double signed_distance(const Vec3& point) const = 0;

protected:
    explicit AnalyticDomain(SurfaceMesh boundary) : boundary_(std::move(boundary)) {}

private:
    SurfaceMesh boundary_;
};

class SphereDomain final : public AnalyticDomain {
public:
    /// 20 * 4^levels triangles.
    explicit SphereDomain(double radius, Vec3 center = Vec3::Zero(), int levels = 4);

    [[nodiscard]] BoundaryPoint closest(const Vec3& point, Index hint = kNone) const override;
    [[nodiscard]] double signed_distance(const Vec3& point) const override;

private:
    double radius_;
    Vec3 center_;
    int levels_;
};

/// A torus around the z axis.
class TorusDomain final : public AnalyticDomain {
public:
    TorusDomain(double major, double minor, int around = 96, int across = 48);

    [[nodiscard]] BoundaryPoint closest(const Vec3& point, Index hint = kNone) const override;
    [[nodiscard]] double signed_distance(const Vec3& point) const override;

private:
    double major_;
    double minor_;
    int around_;
    int across_;
};

/// [0, size] with 12 triangles; a thin plate if one size is small.
class BoxDomain final : public AnalyticDomain {
public:
    explicit BoxDomain(const Vec3& size);

    [[nodiscard]] BoundaryPoint closest(const Vec3& point, Index hint = kNone) const override;
    [[nodiscard]] double signed_distance(const Vec3& point) const override;
    [[nodiscard]] FeatureSet features() const;  ///< The 8 corners and 12 edges.

private:
    Vec3 size_;
};

}  // namespace remesh::testing
