#pragma once

#include <optional>

#include "core/geometry/bvh.h"
#include "core/geometry/domain.h"
#include "core/geometry/winding_number.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// The body that one surface encloses: region 1 where the surface winds around the point by more
/// than half, so that small gaps in it don't matter; region 0 elsewhere.
///
/// Inside test, projection and rays all see this one surface.
class SurfaceDomain final : public Domain {
public:
    /// \param skin     at least one triangle, facing outward, all of positive area
    /// \param normals  #V unit normals to interpolate, or empty: normals of the triangles
    explicit SurfaceDomain(SurfaceMesh skin, Points normals = {});

    [[nodiscard]] int region_at(const Vec3& point) const override;
    /// \throws Error{Unmeshable} if the point isn't finite, or so far away that its distance isn't
    [[nodiscard]] BoundaryPoint closest(const Vec3& point, Index hint = kNone) const override;
    [[nodiscard]] std::optional<BoundaryPoint> closest_within(const Vec3& point, double radius,
                                                              Index hint = kNone) const override;
    [[nodiscard]] std::optional<double> first_hit(const Vec3& origin, const Vec3& direction,
                                                  double t_min, double t_max, const Vec3& against,
                                                  double max_cosine) const override;
    [[nodiscard]] const SurfaceMesh& boundary() const override { return skin_; }
    [[nodiscard]] Box bounds() const override { return bounds_; }

private:
    [[nodiscard]] Vec3 normal_at(Index facet, const Vec3& point) const;
    [[nodiscard]] BoundaryPoint boundary_point(const Bvh::Nearest& nearest) const;

    SurfaceMesh skin_;
    Points vertex_normals_;
    Points facet_normals_;
    Bvh bvh_;
    WindingNumber winding_;
    Box bounds_;
};

}  // namespace remesh
