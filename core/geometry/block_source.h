#pragma once

#include <vector>

#include "core/geometry/sizing_source.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// A box where a size is asked for, parallel to the axes of its source. Single precision: there
/// may be millions.
struct SizingBlock {
    Eigen::Vector3f low = Eigen::Vector3f::Zero();
    Eigen::Vector3f high = Eigen::Vector3f::Zero();
    float h = 0.0F;  ///< > 0.
};

/// min_i (h_i + gradation distance(x, block i)), found by branch and bound on a k-d tree.
class BlockSource final : public SizingSource {
public:
    /// \param axes       columns: orthonormal directions that the blocks are parallel to
    /// \param origin     where their coordinates are 0
    /// \param gradation  > 0
    BlockSource(std::vector<SizingBlock> blocks, const Eigen::Matrix3d& axes, const Vec3& origin,
                double gradation);

    [[nodiscard]] double least_within(const Vec3& center, double radius,
                                      double best) const override;
    [[nodiscard]] double least() const override;
    [[nodiscard]] double gradation() const override { return gradation_; }

private:
    struct Node {
        SizingBlock bound{};  // Around all blocks below; their least h.
        Index first = 0;      // Blocks of a leaf.
        Index count = 0;
        Index right = kNone;  // The left child follows its parent; kNone for a leaf.
    };

    Index build(Index first, Index count);
    [[nodiscard]] double bound(const SizingBlock& block, const Vec3& local, double radius) const;

    std::vector<SizingBlock> blocks_;
    std::vector<Node> nodes_{};
    Eigen::Matrix3d to_local_;
    Vec3 origin_;
    double gradation_;
};

}  // namespace remesh
