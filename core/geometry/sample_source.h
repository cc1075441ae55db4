#pragma once

#include <vector>

#include "core/geometry/sizing_source.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// A point where a size is asked for.
struct SizingSample {
    Vec3 x = Vec3::Zero();
    double h = 0.0;       ///< > 0.
    double radius = 0.0;  ///< Of the ball where it holds unchanged, >= 0: about half the samples'
                          ///< spacing, or the size would rise between them.
};

/// min_i (h_i + gradation max(0, |x - x_i| - radius_i)), exactly.
///
/// Found by branch and bound on a k-d tree whose nodes know their least h_i. Samples that another
/// one makes void everywhere are left out.
class SampleSource final : public SizingSource {
public:
    /// \param gradation  > 0
    SampleSource(std::vector<SizingSample> samples, double gradation);

    [[nodiscard]] double least_within(const Vec3& center, double radius,
                                      double best) const override;
    [[nodiscard]] double least() const override;
    [[nodiscard]] double gradation() const override { return gradation_; }
    [[nodiscard]] std::size_t size() const { return samples_.size(); }

private:
    struct Node {
        Box box{};
        double least = 0.0;   // h_i of the samples below.
        double radius = 0.0;  // Largest of the samples below.
        Index first = 0;      // Samples of a leaf.
        Index count = 0;
        Index right = kNone;  // The left child follows its parent; kNone for a leaf.
    };

    void drop_void_samples();
    void build();
    Index build(Index first, Index count);
    [[nodiscard]] double bound(const Node& node, const Vec3& center, double radius) const;

    std::vector<SizingSample> samples_;
    std::vector<Node> nodes_{};
    double gradation_;
};

}  // namespace remesh
