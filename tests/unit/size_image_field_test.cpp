// Images of sizes: lattices to a sizing field.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/estimate.h"
#include "core/geometry/spatial_hash.h"
#include "core/stages/sizing.h"
#include "core/stages/sizing/image.h"
#include "tests/support/analytic_domain.h"
#include "tests/support/shapes.h"

namespace remesh::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// 1 mm voxels around the origin, 41 along each axis.
SizeImage lattice(const std::function<double(const Vec3&)>& size) {
    SizeImage image;
    image.size = {41, 41, 41};
    image.origin = Vec3::Constant(-20.0);
    for (int k = 0; k < 41; ++k) {
        for (int j = 0; j < 41; ++j) {
            for (int i = 0; i < 41; ++i) {
                image.sizes.push_back(static_cast<float>(size(image.origin + Vec3(i, j, k))));
            }
        }
    }
    return image;
}

std::shared_ptr<const SizingField> field_of(SizeImage image, double max_size,
                                            std::vector<std::string>* codes = nullptr) {
    RunContext run({}, [&](const RunEvent& event) {
        if (const auto* warning = std::get_if<Warning>(&event); warning != nullptr && codes) {
            codes->push_back(warning->code);
        }
    });
    SizingOptions options;
    options.guard_thickness = false;
    options.max_size = max_size;
    options.image = std::make_shared<SizeImage>(std::move(image));
    const SphereDomain ball(10.0);
    return build_sizing_field(ball, {}, 1.0, options, run).field;
}

Vec3 random_point(std::uint64_t i) {
    return 20.0 * (Vec3(hash_random(7, i, 0), hash_random(7, i, 1), hash_random(7, i, 2)) -
                   Vec3::Constant(0.5));
}

double gentle(const Vec3& x) {
    return 2.0 + 0.05 * x.x() - 0.02 * x.z();
}

TEST(SizeImageField, IsTheInterpolatedImageWhereThatIsGentle) {
    const auto field = field_of(lattice(gentle), 6.0);

    for (std::uint64_t i = 0; i < 500; ++i) {
        const Vec3 x = random_point(i);
        EXPECT_NEAR(field->h(x), gentle(x), 0.04 * gentle(x));
    }
}

TEST(SizeImageField, DividesVoxelsThatAreLargerThanTheirSizes) {
    SizeImage image;
    image.size = {5, 5, 5};
    image.spacing = Vec3::Constant(8.0);
    image.origin = Vec3::Constant(-16.0);
    for (int i = 0; i < 125; ++i) {
        image.sizes.push_back(static_cast<float>(gentle({8.0 * (i % 5) - 16.0, 0.0, 0.0})));
    }

    const auto field = field_of(image, 6.0);

    for (std::uint64_t i = 0; i < 200; ++i) {
        const Vec3 x = random_point(i);
        const double wanted = gentle({x.x(), 0.0, 0.0});
        EXPECT_NEAR(field->h(x), wanted, 0.04 * wanted);
    }
}

TEST(SizeImageField, IsNoSteeperThanTheGradationWhateverTheImage) {
    const auto field = field_of(
        lattice([](const Vec3& x) { return x.norm() < 4.0 ? 0.7 : (x.x() > 0.0 ? 5.0 : 3.0); }),
        5.0);

    EXPECT_FLOAT_EQ(static_cast<float>(field->h(Vec3::Zero())), 0.7F);
    for (std::uint64_t i = 0; i < 500; ++i) {
        const Vec3 x = random_point(i);
        const Vec3 y = x + 0.1 * random_point(900 + i);
        EXPECT_LE(std::abs(field->h(x) - field->h(y)), 0.2 * (x - y).norm() + 1e-6);
    }
}

TEST(SizeImageField, TakesWhatIsNotAboveZeroForNoWish) {
    std::vector<std::string> codes;

    const auto none = field_of(lattice([](const Vec3& x) {
                                   return x.x() > 0.0 ? 0.0 : x.y() > 0.0 ? -3.0 : std::nan("");
                               }),
                               5.0, &codes);
    const auto half = field_of(lattice([](const Vec3& x) { return x.x() > 0.0 ? 0.0 : 2.0; }), 5.0);

    EXPECT_TRUE(none->is_uniform());
    EXPECT_THAT(codes, ElementsAre("SIZE_IMAGE_EMPTY"));
    // Voxels with a wish end at 0.5.
    EXPECT_NEAR(half->h({-5, 0, 0}), 2.0, 1e-6);
    EXPECT_NEAR(half->h({5.5, 0, 0}), 3.0, 1e-6);
}

TEST(SizeImageField, WarnsWhereTheImageCoversAPartOnly) {
    SizeImage image = lattice(gentle);
    std::vector<std::string> codes;
    image.origin.x() += 20.0;

    static_cast<void>(field_of(image, 6.0, &codes));

    EXPECT_THAT(codes, ElementsAre("SIZE_IMAGE_COVERAGE"));
}

TEST(SizeImageField, SaysNothingOfAnImageThatFits) {
    std::vector<std::string> codes;

    static_cast<void>(field_of(lattice(gentle), 6.0, &codes));

    EXPECT_THAT(codes, IsEmpty());
}

TEST(SizeImageField, RefusesAnImageThatLiesApart) {
    SizeImage image = lattice(gentle);
    image.origin.x() += 60.0;
    image.assumes_space = true;
    SurfaceMesh body = icosphere(2);
    for (Vec3& x : body.vertices) {
        x += Vec3(-60.0, 0.0, 0.0);
    }

    const auto refusal = [&]() -> std::string {
        try {
            require_overlap(image, body);
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::InvalidInput);
            return error.what();
        }
        return "";
    }();

    EXPECT_THAT(refusal, HasSubstr("must overlap the surface"));
    EXPECT_THAT(refusal, HasSubstr("were the surface in RAS"));
}

TEST(SizeImageField, IsWhatAnEstimateGoesBy) {
    SurfaceMesh body = icosphere(3);
    for (Vec3& x : body.vertices) {
        x *= 10.0;
    }
    RemeshOptions options;
    options.edge_length = 4.0;
    const auto coarse = estimate_run(body, options);

    options.sizing.image = std::make_shared<SizeImage>(lattice([](const Vec3&) { return 1.0; }));
    const auto fine = estimate_run(body, options);

    EXPECT_NEAR(static_cast<double>(fine.tets), 9.0 * 4189.0 + 2.0 * 2.31 * 1257.0, 4000.0);
    EXPECT_GT(fine.tets, 20 * coarse.tets);
}

}  // namespace
}  // namespace remesh::testing
