#include "core/geometry/curve_track.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace remesh {

CurveTrack::CurveTrack(Points points, bool is_closed)
    : points_(std::move(points)), is_closed_(is_closed) {
    arc_.reserve(points_.size());
    arc_.push_back(0.0);
    for (std::size_t i = 1; i < points_.size(); ++i) {
        arc_.push_back(arc_.back() + (points_[i] - points_[i - 1]).norm());
    }
}

CurveTrack::Place CurveTrack::at(double arc) const {
    if (is_closed_ && length() > 0.0) {
        arc -= length() * std::floor(arc / length());
    }
    arc = std::clamp(arc, 0.0, length());
    const auto after = std::upper_bound(arc_.begin() + 1, arc_.end() - 1, arc);
    const auto i = static_cast<std::size_t>(after - arc_.begin());
    const Vec3 along = points_[i] - points_[i - 1];
    const double size = arc_[i] - arc_[i - 1];
    const double share = size > 0.0 ? (arc - arc_[i - 1]) / size : 0.0;
    return {.point = points_[i - 1] + share * along, .tangent = along.normalized()};
}

double CurveTrack::arc_of(const Vec3& x) const {
    double best = std::numeric_limits<double>::infinity();
    double arc = 0.0;
    for (std::size_t i = 1; i < points_.size(); ++i) {
        const Vec3 along = points_[i] - points_[i - 1];
        const double squared = along.squaredNorm();
        const double share =
            squared > 0.0 ? std::clamp((x - points_[i - 1]).dot(along) / squared, 0.0, 1.0) : 0.0;
        const double distance = (points_[i - 1] + share * along - x).squaredNorm();
        if (distance < best) {
            best = distance;
            arc = arc_[i - 1] + share * (arc_[i] - arc_[i - 1]);
        }
    }
    return arc;
}

}  // namespace remesh
