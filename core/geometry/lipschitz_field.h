#pragma once

#include <vector>

#include "core/geometry/sizing_field.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// Where a spacing is asked for.
struct SizingSample {
    Vec3 x = Vec3::Zero();
    double h = 0.0;  ///< > 0.
};

/// The largest field that honours every sample and grows no faster than its gradation:
/// h(x) = min(h_max, min_i (h_i + gradation max(0, |x - x_i| - plateau))).
///
/// Found by branch and bound on a k-d tree whose nodes know their least h_i, so it is exactly
/// Lipschitz: nothing is interpolated.
class LipschitzField final : public SizingField {
public:
    /// \param h_max      away from all samples, > 0
    /// \param gradation  > 0
    /// \param plateau    radius around each sample where it holds unchanged, >= 0: about the
    /// samples'
    ///                   spacing, or h would rise between them
    LipschitzField(std::vector<SizingSample> samples, double h_max, double gradation,
                   double plateau = 0.0);

    [[nodiscard]] double h(const Vec3& point) const override;
    [[nodiscard]] double h_min() const override { return h_min_; }
    [[nodiscard]] double h_max() const override { return h_max_; }
    [[nodiscard]] double gradation() const override { return gradation_; }

private:
    struct Node {
        Box box{};
        double least = 0.0;  // h_i of the samples below.
        Index first = 0;     // Samples of a leaf.
        Index count = 0;
        Index right = kNone;  // The left child follows its parent; kNone for a leaf.
    };

    Index build(Index first, Index count);
    [[nodiscard]] double bound(const Node& node, const Vec3& point) const;

    std::vector<SizingSample> samples_;
    std::vector<Node> nodes_{};
    double h_min_;
    double h_max_;
    double gradation_;
    double plateau_;
};

}  // namespace remesh
