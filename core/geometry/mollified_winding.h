#pragma once

#include <optional>

#include "core/geometry/winding_number.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// The winding number averaged over a ball: a smooth field whose level 1/2 is a smoothed surface.
///
/// The kernel phi(u) ~ (1 - u^2)^2 (1 - 2.2 u^2), u = distance / radius, has no second moment, so
/// that curved surfaces don't shrink to leading order. Beyond the radius the kernel changes
/// nothing, so only near triangles cost more than in the fast winding number.
class MollifiedWinding {
public:
    struct Sample {
        double value = 0.0;
        Vec3 gradient = Vec3::Zero();  ///< Per model unit; points inward.
    };
    struct Projection {
        Vec3 point = Vec3::Zero();
        Vec3 normal = Vec3::Zero();  ///< Unit, outward.
    };

    /// \param winding  must outlive this object
    explicit MollifiedWinding(const WindingNumber& winding) : tree_(winding.tree()) {}

    /// \param radius  of the ball, model units, > 0
    [[nodiscard]] Sample at(const Vec3& point, double radius) const;

    /// Newton's method to the level 1/2. Nothing if the field is too flat, or the way is longer
    /// than `reach`, or it doesn't settle.
    ///
    /// \param sample  the field at `point`
    [[nodiscard]] std::optional<Projection> project(const Vec3& point, const Sample& sample,
                                                    double radius, double reach) const;

private:
    const WindingTree& tree_;
};

}  // namespace remesh
