#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// Wanted edge lengths on a lattice of voxels, which may be turned and may mirror.
struct SizeImage {
    std::array<Index, 3> size{};  ///< Voxels along each axis, >= 1.
    Vec3 origin = Vec3::Zero();   ///< Centre of the first voxel, model units.
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< Columns: orthonormal directions.
    Vec3 spacing = Vec3::Ones();                         ///< Of voxels along each axis, > 0.
    std::vector<float> sizes{};  ///< Model units, first axis fastest; what isn't greater than 0
                                 ///< or isn't finite is no wish.
    bool assumes_space = false;  ///< Nobody said which space the surface is in.

    /// Coordinates along the axes, in model units from the centre of the first voxel.
    [[nodiscard]] Vec3 local(const Vec3& point) const {
        return axes.transpose() * (point - origin);
    }
    /// Whether a point lies in one of the voxels.
    [[nodiscard]] bool covers(const Vec3& point) const {
        const Vec3 voxels = local(point).cwiseQuotient(spacing);
        for (Eigen::Index axis = 0; axis < 3; ++axis) {
            if (!(voxels[axis] >= -0.5 &&
                  voxels[axis] <= size[static_cast<std::size_t>(axis)] - 0.5)) {
                return false;
            }
        }
        return true;
    }
    /// Box around all voxels, parallel to the axes of the model.
    [[nodiscard]] Box bounds() const;
};

}  // namespace remesh
