#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/geometry/wide_tree.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// Signed solid angle of a triangle seen from p, in (-2 pi, 2 pi): positive if p is behind it.
/// Source: Van Oosterom and Strackee, The Solid Angle of a Plane Triangle, 1983, equation 8.
[[nodiscard]] double solid_angle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

/// Hierarchy for sums of solid angles: what a far group of triangles looks like, four groups at a
/// time, in the floats of WideTree.
struct WindingTree {
    struct Node {
        std::array<Lanes, 3> center;  ///< Area-weighted middle of the group.
        std::array<Lanes, 3> area;    ///< Sum of area vectors.
        std::array<Lanes, 6> moment;  ///< First moments, symmetric part: xx, yy, zz, xy, xz, yz.
        Lanes trace;                  ///< xx + yy + zz.
        Lanes radius;                 ///< All triangles lie within it around the center.
        std::array<std::int32_t, 4> child;  ///< As in WideTree.
    };
    struct Leaf {
        std::array<std::array<Lanes, 3>, 3> corner;  ///< [corner][axis]; spare lanes have no area.
    };

    Vec3 center = Vec3::Zero();
    double scale = 1.0;
    std::vector<Node> nodes{};
    std::vector<Leaf> leaves{};

    /// Dipole and first-order terms of a node's four groups for the offsets d of their centers.
    [[nodiscard, gnu::always_inline]] static Lanes far_terms(const Node& node,
                                                             const std::array<Lanes, 3>& d,
                                                             const Lanes& distance2) {
        const Lanes inverse2 = 1.0F / distance2;
        const Lanes inverse3 = inverse2 * inverse2.sqrt();
        const Lanes dipole = node.area[0] * d[0] + node.area[1] * d[1] + node.area[2] * d[2];
        const Lanes quadratic =
            node.moment[0] * d[0] * d[0] + node.moment[1] * d[1] * d[1] +
            node.moment[2] * d[2] * d[2] +
            2.0F * (node.moment[3] * d[0] * d[1] + node.moment[4] * d[0] * d[2] +
                    node.moment[5] * d[1] * d[2]);
        return inverse3 * (dipole + node.trace - 3.0F * inverse2 * quadratic);
    }

    /// Half the sum of the solid angles of a leaf's triangles.
    [[nodiscard]] static float half_solid_angles(const Leaf& leaf, const Eigen::Vector3f& p);
};

/// The generalized winding number of any triangles: how often they go around a point.
///
/// 1 inside and 0 outside of a closed surface, in between where there are holes, 2 where closed
/// parts overlap, negative where the surface faces inward. A query costs O(log n); its error is
/// 0.02 (rms) and below about 0.06. Source: Barill et al., Fast Winding Numbers for Soups and
/// Clouds, 2018: first- order expansion, accuracy parameter beta = 2.
class WindingNumber {
public:
    WindingNumber() = default;
    /// \param triangles  over finite `vertices`, indices in range
    WindingNumber(const Points& vertices, const std::vector<Triangle>& triangles);

    [[nodiscard]] double at(const Vec3& point) const;

    [[nodiscard]] const WindingTree& tree() const { return tree_; }

private:
    WindingTree tree_;
};

}  // namespace remesh
