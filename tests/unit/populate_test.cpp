#include "core/stages/populate.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/error.h"
#include "core/stages/seed.h"
#include "core/stages/tetrahedralize.h"
#include "tests/support/analytic_domain.h"

namespace remesh::testing {
namespace {

constexpr double kSpacing = 0.12;

// A sphere filled with particles.
Particles filled(const Domain& domain, const SizingField& sizing) {
    RunContext run;
    const Particles surface = seed_surface(domain, {}, sizing, {}, run);
    return seed_volume(surface, domain, sizing, {}, {}, run);
}

PopulationResult controlled(const Particles& particles, const Domain& domain,
                            const SizingField& sizing) {
    RunContext run;
    return control_population(particles, tetrahedralize(particles.position, run), domain, sizing,
                              run);
}

std::ptrdiff_t count_within(const Particles& particles, const Vec3& x, double radius) {
    return std::count_if(particles.position.begin(), particles.position.end(),
                         [&](const Vec3& y) { return (x - y).norm() < radius; });
}

TEST(ControlPopulation, FillsAHole) {
    const SphereDomain sphere(1.0);
    const UniformSizing sizing(kSpacing);
    const Particles full = filled(sphere, sizing);
    Particles holed;
    for (std::size_t i = 0; i < full.size(); ++i) {
        if (full.position[i].norm() > 1.5 * kSpacing) {
            holed.add(full.position[i], full.kind[i], full.anchor[i], full.h[i], full.normal[i]);
        }
    }
    ASSERT_LT(holed.size(), full.size());

    const PopulationResult result = controlled(holed, sphere, sizing);

    EXPECT_GT(result.inserted, 0);
    EXPECT_GT(count_within(result.particles, Vec3::Zero(), 0.8 * kSpacing), 0);
}

TEST(ControlPopulation, TakesOneOfTwoThatAreTooClose) {
    const SphereDomain sphere(1.0);
    const UniformSizing sizing(kSpacing);
    Particles crowded = filled(sphere, sizing);
    const auto inner = std::find_if(crowded.position.begin(), crowded.position.end(),
                                    [](const Vec3& x) { return x.norm() < 0.3; });
    ASSERT_NE(inner, crowded.position.end());
    const Vec3 beside = *inner + Vec3(0.1 * kSpacing, 0.0, 0.0);
    crowded.add(beside, ParticleKind::Volume, kNone, kSpacing, Vec3::Zero());
    ASSERT_EQ(count_within(crowded, beside, 0.3 * kSpacing), 2);

    const Particles controlled_ones = controlled(crowded, sphere, sizing).particles;

    EXPECT_EQ(count_within(controlled_ones, beside, 0.3 * kSpacing), 1);
}

TEST(ControlPopulation, LeavesTheBoundaryAloneAndStaysInside) {
    const TorusDomain torus(1.0, 0.4);
    const UniformSizing sizing(kSpacing);
    const Particles all = filled(torus, sizing);
    const auto on_boundary = [](const Particles& particles) {
        return std::count(particles.kind.begin(), particles.kind.end(), ParticleKind::Surface);
    };

    // As if larger elements were wanted now, and then smaller ones.
    for (const double factor : {1.6, 0.7}) {
        Particles rescaled = all;
        std::fill(rescaled.h.begin(), rescaled.h.end(), factor * kSpacing);
        const PopulationResult result =
            controlled(rescaled, torus, UniformSizing(factor * kSpacing));

        EXPECT_EQ(on_boundary(result.particles), on_boundary(all));
        EXPECT_GT(factor > 1.0 ? result.removed : result.inserted, 0);
        for (std::size_t i = 0; i < result.particles.size(); ++i) {
            if (result.particles.kind[i] == ParticleKind::Volume) {
                EXPECT_LT(torus.signed_distance(result.particles.position[i]), 0.0);
            }
        }
    }
}

TEST(ControlPopulation, RefusesTooManyPasses) {
    EXPECT_THROW(validate(PopulationOptions{.passes = 21}), Error);
    EXPECT_THROW(validate(PopulationOptions{.passes = -1}), Error);
}

}  // namespace
}  // namespace remesh::testing
