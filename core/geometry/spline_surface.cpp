#include "core/geometry/spline_surface.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace remesh {
namespace {

using Matrix4 = Eigen::Matrix4d;

/// What value and gradient at x owe to a value and a gradient at y, d = x - y: the kernel r^3,
/// differentiated by x down the rows and by y along the columns.
Matrix4 influence(const Vec3& d) {
    const double r = d.norm();
    Matrix4 block = Matrix4::Zero();
    if (r > 0.0) {
        const Vec3 slope = 3.0 * r * d;
        block(0, 0) = r * r * r;
        block.block<3, 1>(1, 0) = slope;
        block.block<1, 3>(0, 1) = -slope.transpose();
        block.block<3, 3>(1, 1) = -3.0 * (r * Eigen::Matrix3d::Identity() + d * d.transpose() / r);
    }
    return block;
}

/// What value and gradient at x owe to the linear polynomial.
Matrix4 tail(const Vec3& x) {
    Matrix4 block = Matrix4::Identity();
    block.block<1, 3>(0, 1) = x.transpose();
    return block;
}

Eigen::MatrixXd system_of(const Points& points, double smoothness) {
    const auto n = static_cast<Eigen::Index>(points.size());
    Eigen::MatrixXd system = Eigen::MatrixXd::Zero(4 * n + 4, 4 * n + 4);
    for (Eigen::Index j = 0; j < n; ++j) {
        for (Eigen::Index i = 0; i < n; ++i) {
            system.block<4, 4>(4 * i, 4 * j) = influence(points[static_cast<std::size_t>(i)] -
                                                         points[static_cast<std::size_t>(j)]);
        }
        system.block<4, 4>(4 * j, 4 * j).diagonal().setConstant(smoothness);
        const Matrix4 block = tail(points[static_cast<std::size_t>(j)]);
        system.block<4, 4>(4 * j, 4 * n) = block;
        system.block<4, 4>(4 * n, 4 * j) = block.transpose();
    }
    return system;
}

}  // namespace

std::optional<SplineSurface> SplineSurface::through(const Points& points, const Points& normals,
                                                    double smoothness) {
    const std::size_t n = points.size();
    const Box box = bounding_box(points);
    if (n < 4 || !(box.diagonal() > 0.0)) {
        return std::nullopt;
    }
    SplineSurface spline;
    spline.center_ = 0.5 * (box.low + box.high);
    spline.size_ = 0.5 * box.diagonal();
    for (const Vec3& point : points) {
        spline.points_.emplace_back((point - spline.center_) / spline.size_);
    }
    const auto rows = static_cast<Eigen::Index>(4 * n);
    Eigen::VectorXd wanted = Eigen::VectorXd::Zero(rows + 4);
    for (std::size_t i = 0; i < n; ++i) {
        wanted.segment<3>(static_cast<Eigen::Index>(4 * i + 1)) = normals[i];
    }
    const Eigen::VectorXd weights =
        system_of(spline.points_, smoothness).partialPivLu().solve(wanted);
    if (!weights.allFinite()) {
        return std::nullopt;
    }
    for (Eigen::Index i = 0; i < rows; i += 4) {
        spline.weights_.emplace_back(weights.segment<4>(i));
    }
    spline.plane_ = weights.segment<4>(rows);
    return spline;
}

double SplineSurface::at(const Vec3& point) const {
    const Vec3 x = (point - center_) / size_;
    double sum = plane_[0] + plane_.tail<3>().dot(x);
    for (std::size_t i = 0; i < points_.size(); ++i) {
        const Vec3 d = x - points_[i];
        const double r2 = d.squaredNorm();
        sum += std::sqrt(r2) * (r2 * weights_[i][0] - 3.0 * d.dot(weights_[i].tail<3>()));
    }
    return size_ * sum;
}

}  // namespace remesh
