#pragma once

#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// A polyline that knows its arc length.
class CurveTrack {
public:
    struct Place {
        Vec3 point = Vec3::Zero();
        Vec3 tangent = Vec3::Zero();  ///< Unit.
    };

    /// \param points  at least 2; first and last equal if closed
    CurveTrack(Points points, bool is_closed);

    [[nodiscard]] double length() const { return arc_.back(); }
    [[nodiscard]] bool is_closed() const { return is_closed_; }

    /// Point at an arc length from the start; wrapped on a closed curve, else clamped.
    [[nodiscard]] Place at(double arc) const;

    /// Arc length of the point of the curve that is closest to `x`. O(#points).
    [[nodiscard]] double arc_of(const Vec3& x) const;

private:
    Points points_;
    std::vector<double> arc_;  // Of every point.
    bool is_closed_;
};

}  // namespace remesh
