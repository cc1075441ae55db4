#pragma once

#include <Eigen/Core>

#include <optional>

#include "core/mesh/mesh.h"

namespace remesh {

/// A smooth function that vanishes on given points and grows along their normals: the least bent
/// surface through them that also takes their tangents.
///
/// Hermite interpolation by the polyharmonic spline r^3 with a linear polynomial. n points cost
/// O(n^3) to make, memory of (4 n)^2 numbers, and O(n) a query. Source: Macedo et al., Hermite
/// Radial Basis Functions Implicits, 2011.
class SplineSurface {
public:
    /// \param points      #N positions, distinct, N >= 4
    /// \param normals     #N unit vectors, outward
    /// \param smoothness  0 to pass through all points; about 1e-3 lets it pass beside noisy ones
    /// \return            nothing if the points don't determine such a function
    static std::optional<SplineSurface> through(const Points& points, const Points& normals,
                                                double smoothness);

    /// About the signed distance near the points, model units; negative inside.
    [[nodiscard]] double at(const Vec3& point) const;

private:
    Vec3 center_ = Vec3::Zero();
    double size_ = 1.0;                       // Of the points around their center.
    Points points_;                           // In units of size_ around center_.
    std::vector<Eigen::Vector4d> weights_{};  // Of each point: value and gradient.
    Eigen::Vector4d plane_ = Eigen::Vector4d::Zero();
};

}  // namespace remesh
