#include "core/mesh/quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/shapes.h"

namespace remesh {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

// A regular tet with edge 2 sqrt(2), positively oriented.
const Vec3 kA(1, 1, 1);
const Vec3 kB(-1, 1, -1);
const Vec3 kC(1, -1, -1);
const Vec3 kD(-1, -1, 1);

TEST(TetQualityMeasures, RegularTetHasVolumeRatioAndAnglesOfTheClosedForm) {
    EXPECT_NEAR(std::abs(tet_volume(kA, kB, kC, kD)), 8.0 / 3.0, 1e-12);
    EXPECT_NEAR(std::abs(tet_radius_ratio(kA, kB, kC, kD)), 1.0, 1e-12);
    const auto angles = dihedral_angles(kA, kB, kC, kD);
    EXPECT_NEAR(angles.min * kDegrees, 70.528779, 1e-6);
    EXPECT_NEAR(angles.max * kDegrees, 70.528779, 1e-6);
}

TEST(TetQualityMeasures, CornerTetHasTheRadiusRatioOfTheClosedForm) {
    const Vec3 o(0, 0, 0);
    // r_in = 1 / (3 + sqrt 3), r_circ = sqrt(3) / 2.
    const double expected = 3.0 / (3.0 + std::sqrt(3.0)) / (std::sqrt(3.0) / 2.0);

    EXPECT_NEAR(tet_radius_ratio(o, Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()), expected, 1e-12);
}

TEST(TetQualityMeasures, SwappingTwoCornersTurnsTheSign) {
    EXPECT_DOUBLE_EQ(tet_radius_ratio(kA, kB, kC, kD), -tet_radius_ratio(kB, kA, kC, kD));
    EXPECT_DOUBLE_EQ(tet_volume(kA, kB, kC, kD), -tet_volume(kB, kA, kC, kD));
}

TEST(TetQualityMeasures, FlatAndCollapsedTetsHaveQualityZero) {
    EXPECT_DOUBLE_EQ(tet_radius_ratio(kA, kB, kC, 0.5 * (kA + kB)), 0.0);
    EXPECT_DOUBLE_EQ(tet_radius_ratio(kA, kA, kA, kA), 0.0);
}

TEST(TetQualityMeasures, DoNotDependOnScale) {
    EXPECT_NEAR(tet_radius_ratio(1e-6 * kA, 1e-6 * kB, 1e-6 * kC, 1e-6 * Vec3(0, 0, 3)),
                tet_radius_ratio(1e6 * kA, 1e6 * kB, 1e6 * kC, 1e6 * Vec3(0, 0, 3)), 1e-12);
}

TEST(TriangleQualityMeasures, EquilateralIsOneAndFlatIsZero) {
    const Vec3 a(0, 0, 0);
    const Vec3 b(1, 0, 0);

    EXPECT_NEAR(triangle_radius_ratio(a, b, Vec3(0.5, std::sqrt(0.75), 0)), 1.0, 1e-12);
    EXPECT_DOUBLE_EQ(triangle_radius_ratio(a, b, Vec3(0.3, 0, 0)), 0.0);
    EXPECT_DOUBLE_EQ(triangle_radius_ratio(a, a, a), 0.0);
}

TEST(TriangleQualityMeasures, RightTriangleHasItsAngles) {
    const auto angles = triangle_angles(Vec3(0, 0, 0), Vec3(std::sqrt(3.0), 0, 0), Vec3(0, 1, 0));

    EXPECT_NEAR(angles.min * kDegrees, 30.0, 1e-9);
    EXPECT_NEAR(angles.max * kDegrees, 90.0, 1e-9);
}

TEST(SurfaceMeasures, VolumeAndAreaOfCubeAndLShape) {
    EXPECT_NEAR(enclosed_volume(testing::unit_cube()), 1.0, 1e-12);
    EXPECT_NEAR(surface_area(testing::unit_cube()), 6.0, 1e-12);
    EXPECT_NEAR(enclosed_volume(testing::l_shape()), 3.0, 1e-12);
}

TEST(SurfaceMeasures, SphereVolumeConvergesToTheClosedForm) {
    EXPECT_NEAR(enclosed_volume(testing::icosphere(5)), 4.0 / 3.0 * std::numbers::pi, 5e-3);
}

TEST(SurfaceMeasures, VolumeKeepsItsDigitsFarFromTheOrigin) {
    const auto far = testing::transformed(testing::unit_cube(), Eigen::Matrix3d::Identity(),
                                          Vec3::Constant(1e6));

    EXPECT_NEAR(enclosed_volume(far), 1.0, 1e-9);
}

}  // namespace
}  // namespace remesh
