#include "core/stages/seed.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <numbers>
#include <stop_token>

#include "core/error.h"
#include "core/geometry/lipschitz_field.h"
#include "core/geometry/sample_source.h"
#include "tests/support/analytic_domain.h"

namespace remesh::testing {
namespace {

std::size_t count(const Particles& particles, ParticleKind kind) {
    return static_cast<std::size_t>(std::count(particles.kind.begin(), particles.kind.end(), kind));
}

// Least distance over the mean h of all pairs of at least one of the kinds.
double least_spacing(const Particles& particles, ParticleKind a, ParticleKind b) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < particles.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            const bool is_pair = (particles.kind[i] == a && particles.kind[j] == b) ||
                                 (particles.kind[i] == b && particles.kind[j] == a);
            if (is_pair) {
                least =
                    std::min(least, 2.0 * (particles.position[i] - particles.position[j]).norm() /
                                        (particles.h[i] + particles.h[j]));
            }
        }
    }
    return least;
}

Particles surface_of(const Domain& domain, double h, const FeatureSet& features = {}) {
    RunContext run;
    return seed_surface(domain, features, UniformSizing(h), SeedOptions{}, run);
}

Particles all_of(const Domain& domain, double h, std::optional<double> shell = {}) {
    RunContext run;
    return seed_volume(surface_of(domain, h), domain, UniformSizing(h), shell, SeedOptions{}, run);
}

template <typename Call>
ErrorCode code_of(Call call) {
    try {
        call();
    } catch (const Error& error) {
        return error.code();
    }
    return ErrorCode::Internal;
}

TEST(SeedSurface, PutsOneParticleOnEachShareOfTheArea) {
    const double h = 0.05;
    const Particles particles = surface_of(SphereDomain(1.0), h);

    const double wanted = 4.0 * std::numbers::pi / (0.5 * std::numbers::sqrt3 * h * h);
    EXPECT_NEAR(static_cast<double>(particles.size()), wanted, 0.05 * wanted);
}

TEST(SeedSurface, KeepsDartsApartAndOnTheBoundary) {
    const SphereDomain sphere(1.0);
    const Particles particles = surface_of(sphere, 0.1);

    EXPECT_GT(least_spacing(particles, ParticleKind::Surface, ParticleKind::Surface), 0.73);
    for (std::size_t i = 0; i < particles.size(); ++i) {
        EXPECT_NEAR(particles.position[i].norm(), 1.0, 1e-12);
        EXPECT_EQ(sphere.closest(particles.position[i]).facet, particles.anchor[i]);
    }
}

TEST(SeedSurface, OrdersCornersThenCurvesThenSurface) {
    const BoxDomain box(Vec3(1.0, 1.0, 1.0));
    const Particles particles = surface_of(box, 0.1, box.features());

    EXPECT_TRUE(std::is_sorted(particles.kind.begin(), particles.kind.end(), std::greater<>()));
    EXPECT_EQ(count(particles, ParticleKind::Corner), 8u);
    EXPECT_EQ(count(particles, ParticleKind::Curve), 12u * 9u);
    EXPECT_NEAR(least_spacing(particles, ParticleKind::Curve, ParticleKind::Curve), 1.0, 1e-9);
    EXPECT_NEAR(least_spacing(particles, ParticleKind::Curve, ParticleKind::Corner), 1.0, 1e-9);
}

TEST(SeedSurface, CutsAClosedCurveIntoEqualPieces) {
    const SphereDomain sphere(1.0, Vec3::Zero(), 5);
    FeatureSet equator;
    equator.curves.push_back({.is_closed = true});
    for (int i = 0; i <= 200; ++i) {
        const double angle = 2.0 * std::numbers::pi * (i % 200) / 200.0;
        equator.curves[0].points.emplace_back(std::cos(angle), std::sin(angle), 0.0);
    }
    const Particles particles = surface_of(sphere, 0.1, equator);

    EXPECT_EQ(count(particles, ParticleKind::Curve), 63u);
}

TEST(SeedSurface, LeavesOutFeaturesThatAreNotOnTheBoundary) {
    const FeatureSet stray{.corners = {Vec3(0, 0, 2)},
                           .curves = {{.points = {Vec3(2, 0, 0), Vec3(3, 0, 0)}}}};
    const Particles particles = surface_of(SphereDomain(1.0), 0.2, stray);

    EXPECT_EQ(count(particles, ParticleKind::Surface), particles.size());
}

TEST(SeedSurface, IgnoresTheOtherSideOfAThinSheet) {
    const Particles thin = surface_of(BoxDomain(Vec3(1.0, 1.0, 0.01)), 0.1);

    const double wanted = 2.04 / (0.5 * std::numbers::sqrt3 * 0.01);
    EXPECT_NEAR(static_cast<double>(thin.size()), wanted, 0.1 * wanted);
}

TEST(SeedVolume, KeepsParticlesInsideAndOffTheWall) {
    const TorusDomain torus(1.0, 0.4);
    const double h = 0.08;
    const Particles particles = all_of(torus, h);

    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (particles.kind[i] == ParticleKind::Volume) {
            EXPECT_LE(torus.signed_distance(particles.position[i]), -0.45 * h + 1e-12);
        }
    }
}

TEST(SeedVolume, FindsEverySiteThatAskingAtEachWouldFind) {
    // A lattice of 8 points a cell fills the free part of the ball with 8 / cell^3 a volume.
    const double h = 0.04;
    const double cell = 1.833 * 0.94 * h;
    const Particles particles = all_of(SphereDomain(1.0), h);

    const double free_volume = 4.0 / 3.0 * std::numbers::pi * std::pow(1.0 - 0.45 * h, 3);
    const double wanted = 8.0 * free_volume / std::pow(cell, 3);
    EXPECT_NEAR(static_cast<double>(count(particles, ParticleKind::Volume)), wanted, 0.01 * wanted);
}

TEST(SeedVolume, FillsOnlyAShellIfAsked) {
    const SphereDomain sphere(1.0);
    const double h = 0.06;
    const Particles full = all_of(sphere, h);
    const Particles shell = all_of(sphere, h, 1.5);

    std::size_t in_shell = 0;
    for (std::size_t i = 0; i < full.size(); ++i) {
        in_shell += full.kind[i] == ParticleKind::Volume &&
                    -sphere.signed_distance(full.position[i]) <= 1.5 * h;
    }
    EXPECT_EQ(count(shell, ParticleKind::Volume), in_shell);
}

TEST(SeedVolume, FillsGradedRegionsToTheirDensity) {
    const SphereDomain sphere(1.0);
    const auto source =
        std::make_shared<SampleSource>(std::vector<SizingSample>{{Vec3(0, 0, 1), 0.05}}, 0.3);
    const LipschitzField sizing({source}, 0.05, 0.1);
    RunContext run;
    const Particles surface = seed_surface(sphere, {}, sizing, SeedOptions{}, run);
    const Particles all = seed_volume(surface, sphere, sizing, {}, SeedOptions{}, run);

    EXPECT_GE(least_spacing(all, ParticleKind::Volume, ParticleKind::Volume), 0.7 - 1e-3);
    // Density near the pole: about 1 / (0.77 h^3) particles a volume, h about 0.08 there.
    const auto near_pole = std::count_if(all.position.begin(), all.position.end(), [](auto& x) {
        return (x - Vec3(0, 0, 0.85)).norm() < 0.1;
    });
    EXPECT_GT(near_pole, 5);
}

TEST(Seed, GivesTheSameBytesOnAnyNumberOfThreads) {
    const TorusDomain torus(1.0, 0.4);
    Particles one;
    Particles four;
    tbb::task_arena(1).execute([&] { one = all_of(torus, 0.07); });
    tbb::task_arena(4).execute([&] { four = all_of(torus, 0.07); });

    EXPECT_EQ(one.position, four.position);
    EXPECT_EQ(one.anchor, four.anchor);
}

TEST(Seed, RefusesMoreParticlesThanAllowed) {
    const SphereDomain sphere(1.0);
    SeedOptions options;
    options.max_particles = 1000;
    RunContext run;

    EXPECT_EQ(code_of([&] { seed_surface(sphere, {}, UniformSizing(0.01), options, run); }),
              ErrorCode::TooLarge);
    EXPECT_EQ(code_of([&] { seed_volume({}, sphere, UniformSizing(0.05), {}, options, run); }),
              ErrorCode::TooLarge);
}

TEST(Seed, RefusesOptionsOutOfRange) {
    EXPECT_EQ(code_of([] { validate(SeedOptions{.dart_radius = 0.2}); }), ErrorCode::InvalidInput);
    EXPECT_EQ(code_of([] { validate(SeedOptions{.preload = 2.0}); }), ErrorCode::InvalidInput);
    EXPECT_EQ(code_of([] { validate(SeedOptions{.wall_distance = 0.0}); }),
              ErrorCode::InvalidInput);
    EXPECT_EQ(code_of([] { validate(SeedOptions{.max_particles = 0}); }), ErrorCode::InvalidInput);
}

TEST(Seed, StopsWhenAsked) {
    std::stop_source stop;
    stop.request_stop();
    RunContext run(stop.get_token());
    const SphereDomain sphere(1.0);

    EXPECT_EQ(code_of([&] { seed_surface(sphere, {}, UniformSizing(0.1), SeedOptions{}, run); }),
              ErrorCode::Cancelled);
    EXPECT_EQ(code_of([&] { seed_volume({}, sphere, UniformSizing(0.1), {}, SeedOptions{}, run); }),
              ErrorCode::Cancelled);
}

}  // namespace
}  // namespace remesh::testing
