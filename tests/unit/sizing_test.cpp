#include "core/stages/sizing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/geometry/lipschitz_field.h"
#include "core/geometry/sample_source.h"
#include "core/geometry/spatial_hash.h"
#include "tests/support/analytic_domain.h"

namespace remesh::testing {
namespace {

using ::testing::HasSubstr;

Vec3 random_point(std::uint64_t i) {
    return Vec3(hash_random(7, i, 0), hash_random(7, i, 1), hash_random(7, i, 2));
}

LipschitzField field_over(std::vector<SizingSample> samples) {
    return LipschitzField({std::make_shared<SampleSource>(std::move(samples), 0.3)}, 0.01, 0.2);
}

LipschitzField random_field(std::size_t n, std::vector<SizingSample>& samples) {
    for (std::size_t i = 0; i < n; ++i) {
        samples.push_back(
            {random_point(i), 0.05 + 0.1 * hash_random(8, i, 0), 0.02 * hash_random(9, i, 0)});
    }
    return field_over(samples);
}

std::shared_ptr<const SizingField> field_of(const Domain& domain, double h,
                                            const SizingOptions& options = {},
                                            const FeatureSet& features = {}) {
    RunContext run;
    return build_sizing_field(domain, features, h, options, run).field;
}

std::string refusal_of(const SizingOptions& options) {
    try {
        validate(options, 1.0);
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::InvalidInput);
        return error.what();
    }
    return "";
}

// Largest slope of a field between random points of a box around the origin.
double steepest(const SizingField& field, double half_size) {
    double slope = 0.0;
    for (std::uint64_t i = 0; i < 3000; ++i) {
        const Vec3 x = 2.0 * half_size * (random_point(i) - Vec3::Constant(0.5));
        const Vec3 y = x + 0.1 * half_size * (random_point(5000 + i) - Vec3::Constant(0.5));
        slope = std::max(slope, std::abs(field.h(x) - field.h(y)) / (x - y).norm());
    }
    return slope;
}

TEST(LipschitzFieldTest, IsTheMinimumOverAllSamples) {
    std::vector<SizingSample> samples;
    const LipschitzField field = random_field(500, samples);

    for (std::uint64_t i = 0; i < 200; ++i) {
        const Vec3 x = 1.4 * random_point(1000 + i);
        double slow = 0.2;
        for (const SizingSample& sample : samples) {
            slow = std::min(slow,
                            sample.h + 0.3 * std::max(0.0, (sample.x - x).norm() - sample.radius));
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
    const LipschitzField field({}, 0.01, 0.2);

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

TEST(LipschitzFieldTest, BoundsTheFieldOverABall) {
    std::vector<SizingSample> samples;
    const LipschitzField field = random_field(100, samples);

    for (std::uint64_t i = 0; i < 300; ++i) {
        const Vec3 center = 1.4 * random_point(1000 + i);
        const Vec3 x = center + 0.1 * (random_point(4000 + i) - Vec3::Constant(0.5)).normalized();
        EXPECT_GE(field.h(x), field.least_within(center, 0.1) - 1e-12);
        EXPECT_LE(field.least_within(center, 0.1), field.h(center));
    }
}

TEST(SampleSourceTest, ForgetsSamplesThatOthersMakeVoid) {
    const SampleSource source({{Vec3(0, 0, 0), 0.1}, {Vec3(0.1, 0, 0), 0.12}, {Vec3(1, 0, 0), 0.2}},
                              0.1);

    EXPECT_EQ(source.size(), 2U);
}

TEST(BuildSizingField, IsUniformWithoutTheGuard) {
    const SizingOptions options{.guard_thickness = false};

    EXPECT_TRUE(field_of(BoxDomain(Vec3(1, 1, 0.02)), 0.12, options)->is_uniform());
}

TEST(BuildSizingField, TakesTheCurvatureOfASphere) {
    // h = sqrt(8 eps R).
    const auto field = field_of(SphereDomain(1.0), 0.5, {.chord_error = 0.005});

    for (std::uint64_t i = 0; i < 100; ++i) {
        const Vec3 x = (random_point(i) - Vec3::Constant(0.5)).normalized();
        EXPECT_NEAR(field->h(x), 0.2, 0.004);
    }
}

TEST(BuildSizingField, TakesTheLargerCurvatureOfATorus) {
    // On the outer equator 1 / r rules, r = 0.25.
    const auto field = field_of(TorusDomain(1.0, 0.25, 192, 96), 0.5, {.chord_error = 0.005});

    EXPECT_NEAR(field->h(Vec3(1.25, 0.0, 0.0)), 0.1, 0.004);
    EXPECT_NEAR(field->h(Vec3(1.0, 0.0, 0.25)), 0.1, 0.004);
}

TEST(BuildSizingField, FindsNoCurvatureOnFlatFacesBetweenSharpEdges) {
    const BoxDomain box(Vec3(1.0, 1.0, 1.0));
    const auto field = field_of(box, 0.1, {.chord_error = 0.001}, box.features());

    EXPECT_TRUE(field->is_uniform());
}

TEST(BuildSizingField, GrowsLayersFromTheBoundary) {
    const BoxDomain box(Vec3(4, 4, 4));
    const auto field = field_of(box, 0.5, {.layer = BoundaryLayer{0.1, 1.17}});

    EXPECT_NEAR(field->h(Vec3(2.0, 2.0, 0.0)), 0.1, 1e-12);
    EXPECT_NEAR(field->h(Vec3(2.0, 2.0, 1.0)), 0.1 + 0.2, 1e-12);
    EXPECT_NEAR(field->h(Vec3(2.0, 2.0, 2.0)), 0.5, 1e-12);
    EXPECT_DOUBLE_EQ(field->h_min(), 0.1);
}

TEST(BuildSizingField, GrowsAroundRegionsOfEveryShape) {
    SizingOptions options{.guard_thickness = false, .gradation = 0.1};
    options.regions = {
        {SizingSphere{Vec3(-2, 0, 0), 0.5}, 0.1, {}},
        {SizingBox{Vec3(1, -1, -1), Vec3(2, 1, 1)}, 0.12, 1.17},
        {SizingPolyline{{Vec3(0, 3, -1), Vec3(0, 3, 1)}}, 0.2, {}},
        {SizingPoints{{Vec3(0, -3, 0), Vec3(0, -4, 0)}}, 0.3, {}},
    };
    const auto field = field_of(SphereDomain(5.0), 1.0, options);

    EXPECT_NEAR(field->h(Vec3(-2, 0, 0.4)), 0.1, 1e-12);
    EXPECT_NEAR(field->h(Vec3(-2, 0, 1.5)), 0.1 + 0.1 * 1.0, 1e-12);
    EXPECT_NEAR(field->h(Vec3(1.5, 0.9, 0.0)), 0.12, 1e-12);
    EXPECT_NEAR(field->h(Vec3(3.0, 0.0, 0.0)), 0.12 + 0.2 * 1.0, 1e-12);
    EXPECT_NEAR(field->h(Vec3(0.0, 3.5, 0.5)), 0.2 + 0.1 * 0.5, 1e-12);
    EXPECT_NEAR(field->h(Vec3(0.0, -3.5, 0.0)), 0.3 + 0.1 * 0.5, 1e-12);
    EXPECT_LE(steepest(*field, 5.0), 0.2 + 1e-9);
}

TEST(BuildSizingField, PutsElementsAcrossASlab) {
    const auto field =
        field_of(BoxDomain(Vec3(4, 4, 0.4)), 0.5, {.guard_thickness = false, .elements_across = 4});

    EXPECT_NEAR(field->h(Vec3(2.0, 2.0, 0.0)), 0.4 / (0.93 * 4.0), 0.005);
}

TEST(BuildSizingField, TakesSizesAtVerticesAndBetweenThem) {
    // 1/4 of the height: at z = 1 the upper clamp holds, and below 0 nothing is wished.
    const SphereDomain sphere(1.0);
    VertexSizes wishes{&sphere.boundary()};
    for (const Vec3& x : sphere.boundary().vertices) {
        wishes.sizes.push_back(x.z() > 0.0 ? 0.05 + 0.1 * x.z() : std::nan(""));
    }
    RunContext run;
    const auto field =
        build_sizing_field(sphere, {}, 0.1, {.vertex_field = "size"}, run, wishes).field;

    EXPECT_NEAR(field->h(Vec3(0.8, 0.0, 0.6)), 0.1, 1e-12);
    EXPECT_NEAR(field->h(Vec3(0.96, 0.0, 0.28)), 0.078, 0.004);
    EXPECT_NEAR(field->h(Vec3(0.0, 0.995, 0.1)), 0.06, 0.004);
    EXPECT_EQ(field->h(Vec3(0.0, 0.0, -1.0)), 0.1);
    EXPECT_LE(steepest(*field, 1.0), 0.2 + 1e-9);
}

TEST(BuildSizingField, RefusesAnInputWithoutTheSizesItIsToTake) {
    const SphereDomain sphere(1.0);

    EXPECT_THROW(field_of(sphere, 0.1, {.vertex_field = "size"}), Error);
}

TEST(BuildSizingField, IsNeverSteeperThanItsGradation) {
    for (const double gradation : {0.1, 0.2, 0.3}) {
        SizingOptions options{.gradation = gradation, .chord_error = 0.002};
        options.regions = {{SizingSphere{Vec3(1, 0, 0), 0.0}, 0.02, {}}};
        const auto field = field_of(TorusDomain(1.0, 0.25), 0.3, options);

        EXPECT_LE(steepest(*field, 1.3), gradation + 1e-9);
        EXPECT_LE(field->gradation(), gradation);
    }
}

TEST(BuildSizingField, ClampsToTheSmallestAndLargestSize) {
    SizingOptions options{.min_size = 0.05, .max_size = 0.6};
    options.regions = {{SizingSphere{Vec3::Zero(), 0.0}, 0.01, {}}};
    const auto field = field_of(SphereDomain(5.0), 0.3, options);

    EXPECT_EQ(field->h(Vec3::Zero()), 0.05);
    EXPECT_EQ(field->h(Vec3(4.9, 0, 0)), 0.6);
}

TEST(ValidateSizing, NamesTheFieldItsRangeAndTheValue) {
    EXPECT_THAT(refusal_of({.min_factor = 0.0}), HasSubstr("sizing.min_factor must be in (0, 1]"));
    EXPECT_THAT(refusal_of({.gradation = 0.4}),
                HasSubstr("sizing.gradation must be in (0, 0.3], got 0.4"));
    EXPECT_THAT(refusal_of({.min_size = 2.0}),
                HasSubstr("sizing.min_size must be at most edge_length"));
    EXPECT_THAT(refusal_of({.chord_error = -1.0}), HasSubstr("sizing.chord_error must be > 0"));
    EXPECT_THAT(refusal_of({.gradation = -1e-9}), HasSubstr("in (0, 0.3], got -1e-09"));
    EXPECT_THAT(refusal_of({.gradation = 0.3000001}), HasSubstr("in (0, 0.3], got 0.3000001"));
    EXPECT_THAT(refusal_of({.elements_across = 0.5}), HasSubstr("in [1, 16], got 0.5"));
    EXPECT_THAT(refusal_of({.layer = BoundaryLayer{1.0, 1.5}}),
                HasSubstr("sizing.boundary_layer.growth must be in (1, 1.25], got 1.5"));
    SizingOptions region;
    region.regions = {{SizingPolyline{{Vec3::Zero()}}, 1.0, {}}};
    EXPECT_THAT(refusal_of(region), HasSubstr("sizing.regions[0].polyline must be 2 to"));
}

}  // namespace
}  // namespace remesh::testing
