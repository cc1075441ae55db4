#pragma once

#include <vector>

#include "core/geometry/domain.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"
#include "core/stages/prepare.h"

namespace remesh {

struct FeatureOptions {
    bool detect = true;
    double sharp_angle = 40.0;  ///< An edge bent by more than this is sharp, degrees, in (0, 180).
    double corner_angle =
        50.0;  ///< A curve that turns by more than this has a corner, degrees, in (0, 180).
    double min_length = 6.0;  ///< Connected features shorter than this times h are noise, and twice
                              ///< as long ones if they fade out; >= 0.
};

/// A polyline on the boundary that edges of the mesh must follow.
struct FeatureCurve {
    Points points{};  ///< At least 2; the first and last are equal if closed.
    bool is_closed = false;
};

/// Of h: features farther off the domain than this are left out.
inline constexpr double kOffBoundary = 0.05;

struct FeatureSet {
    Points corners{};  ///< Curve ends, junctions, turns and point-like tips.
    std::vector<FeatureCurve> curves{};

    [[nodiscard]] bool empty() const { return corners.empty() && curves.empty(); }
};

/// A point of a curve, and where the curve runs there.
struct CurvePoint {
    Vec3 point = Vec3::Zero();
    Vec3 tangent = Vec3::Zero();  ///< Unit.
    double arc = 0.0;             ///< Length from the curve's start, model units.
};

/// Closest point of one curve. O(#points of the curve).
[[nodiscard]] CurvePoint closest_on_curve(const FeatureCurve& curve, const Vec3& point);

/// Finds sharp edges, chains them to curves, and marks corners.
///
/// Looks only where the input is consistent enough (sharp-edge density below 0.35, or edges
/// longer than 2.5 h, and not smoothed): stairs and noise have no features.
///
/// \param h  wanted edge length, model units, > 0
/// \throws Error{InvalidInput} if an option is out of range
FeatureSet find_features(const PrepareResult& prepared, double h, const FeatureOptions& options,
                         RunContext& run);

void validate(const FeatureOptions& options);

}  // namespace remesh
