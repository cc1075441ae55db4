#include "core/stages/sizing.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/error.h"
#include "core/geometry/lipschitz_field.h"
#include "core/geometry/spatial_hash.h"
#include "tests/support/analytic_domain.h"

namespace remesh::testing {
namespace {

Vec3 random_point(std::uint64_t i) {
    return Vec3(hash_random(7, i, 0), hash_random(7, i, 1), hash_random(7, i, 2));
}

LipschitzField random_field(std::size_t n, std::vector<SizingSample>& samples) {
    for (std::size_t i = 0; i < n; ++i) {
        samples.push_back({random_point(i), 0.05 + 0.1 * hash_random(8, i, 0)});
    }
    return LipschitzField(samples, 0.2, 0.3, 0.01);
}

std::shared_ptr<const SizingField> field_of(const Domain& domain, double h) {
    RunContext run;
    SizingOptions options;
    options.edge_length = h;
    return build_sizing_field(domain, options, run);
}

ErrorCode code_of(const SizingOptions& options) {
    try {
        validate(options);
    } catch (const Error& error) {
        return error.code();
    }
    return ErrorCode::Internal;
}

TEST(LipschitzFieldTest, IsTheMinimumOverAllSamples) {
    std::vector<SizingSample> samples;
    const LipschitzField field = random_field(500, samples);

    for (std::uint64_t i = 0; i < 200; ++i) {
        const Vec3 x = 1.4 * random_point(1000 + i);
        double slow = 0.2;
        for (const SizingSample& sample : samples) {
            slow = std::min(slow, sample.h + 0.3 * std::max(0.0, (sample.x - x).norm() - 0.01));
        }
        EXPECT_DOUBLE_EQ(field.h(x), slow);
    }
}

TEST(LipschitzFieldTest, GrowsNoFasterThanItsGradation) {
    std::vector<SizingSample> samples;
    const LipschitzField field = random_field(500, samples);

    for (std::uint64_t i = 0; i < 500; ++i) {
        const Vec3 x = random_point(2000 + i);
        const Vec3 y = x + 0.05 * (random_point(3000 + i) - Vec3::Constant(0.5));
        EXPECT_LE(std::abs(field.h(x) - field.h(y)), 0.3 * (x - y).norm() + 1e-12);
    }
}

TEST(LipschitzFieldTest, WithoutSamplesIsItsUpperBound) {
    const LipschitzField field({}, 0.2, 0.3);

    EXPECT_EQ(field.h(Vec3::Zero()), 0.2);
    EXPECT_TRUE(field.is_uniform());
}

TEST(BuildSizingField, IsUniformWhereTheBodyIsThick) {
    const auto field = field_of(SphereDomain(1.0), 0.1);

    EXPECT_TRUE(field->is_uniform());
    EXPECT_EQ(field->h(Vec3::Zero()), 0.1);
}

TEST(BuildSizingField, RefinesAThinPlateToAShareOfItsThickness) {
    const auto field = field_of(BoxDomain(Vec3(1.0, 1.0, 0.1)), 0.12);

    EXPECT_FALSE(field->is_uniform());
    EXPECT_NEAR(field->h(Vec3(0.5, 0.5, 0.0)), 0.075, 0.015);
    EXPECT_NEAR(field->h(Vec3(0.5, 0.5, 0.1)), 0.075, 0.015);
}

TEST(BuildSizingField, NeverRefinesBelowTheLeastFactor) {
    const auto field = field_of(BoxDomain(Vec3(1.0, 1.0, 0.02)), 0.12);

    EXPECT_DOUBLE_EQ(field->h_min(), 0.06);
}

TEST(BuildSizingField, RefinesAGapBetweenTwoWalls) {
    // The hole of this torus is 0.2 wide.
    const TorusDomain torus(0.5, 0.4);
    const auto field = field_of(torus, 0.3);

    EXPECT_LT(field->h(Vec3(0.1, 0.0, 0.0)), 0.25);
}

TEST(BuildSizingField, IsUniformWithoutTheGuard) {
    RunContext run;
    SizingOptions options;
    options.edge_length = 0.12;
    options.guard_thickness = false;

    EXPECT_TRUE(build_sizing_field(BoxDomain(Vec3(1, 1, 0.02)), options, run)->is_uniform());
}

TEST(BuildSizingField, RefusesOptionsOutOfRange) {
    EXPECT_EQ(code_of({.edge_length = 0.0}), ErrorCode::InvalidInput);
    EXPECT_EQ(code_of({.edge_length = 1.0, .min_factor = 0.0}), ErrorCode::InvalidInput);
    EXPECT_EQ(code_of({.edge_length = 1.0, .gradation = 1.5}), ErrorCode::InvalidInput);
}

}  // namespace
}  // namespace remesh::testing
