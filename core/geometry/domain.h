#pragma once

#include <limits>
#include <optional>

#include "core/mesh/mesh.h"

namespace remesh {

/// The point of the boundary that is closest to a query.
struct BoundaryPoint {
    Vec3 point = Vec3::Zero();   ///< On the boundary, model units.
    Vec3 normal = Vec3::Zero();  ///< Unit, outward; smoothly interpolated where the domain smooths.
    Index facet = kNone;  ///< Triangle of `boundary()` it lies on; a warm start for the next query.
    double distance = 0.0;  ///< From the query, model units, >= 0.
};

/// What the mesher asks about the body: which region holds a point, and where its boundary is.
///
/// Everything after `prepare` is written against this class, so that several tissues with common
/// interfaces, or a label map, need no second mesher. All queries are const and safe from any
/// thread, and depend on nothing but their arguments (a warm start changes the cost, never the
/// answer, but for ties).
class Domain {
public:
    virtual ~Domain() = default;

    /// Region that holds a point: 0 outside, 1 and up inside.
    [[nodiscard]] virtual int region_at(const Vec3& point) const = 0;

    /// Closest point of the boundary. `hint` is a facet near the point, or kNone.
    [[nodiscard]] virtual BoundaryPoint closest(const Vec3& point, Index hint = kNone) const = 0;

    /// Closest point of the boundary if it is nearer than `radius`; cheaper than `closest`.
    [[nodiscard]] virtual std::optional<BoundaryPoint> closest_within(const Vec3& point,
                                                                      double radius,
                                                                      Index hint = kNone) const = 0;

    /// Distance along a ray to the first facet in (t_min, t_max) whose normal has a component below
    /// `max_cosine` along `against`; nothing if there is none. For thickness: against = normal at
    /// the origin and max_cosine = -0.3 finds the opposite wall.
    ///
    /// \param direction  unit vector
    [[nodiscard]] virtual std::optional<double> first_hit(const Vec3& origin, const Vec3& direction,
                                                          double t_min, double t_max,
                                                          const Vec3& against,
                                                          double max_cosine) const = 0;

    /// The closed surface that particles are snapped to, facing outward.
    [[nodiscard]] virtual const SurfaceMesh& boundary() const = 0;

    [[nodiscard]] virtual Box bounds() const = 0;
};

}  // namespace remesh
