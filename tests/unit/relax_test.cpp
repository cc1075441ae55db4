#include "core/stages/relax.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <stop_token>
#include <vector>

#include "core/error.h"
#include "core/geometry/lipschitz_field.h"
#include "core/geometry/neighbour_grid.h"
#include "core/geometry/sample_source.h"
#include "core/geometry/spatial_hash.h"
#include "core/stages/seed.h"
#include "tests/support/analytic_domain.h"

namespace remesh::testing {
namespace {

struct Relaxed {
    RelaxResult surface;
    RelaxResult volume;
};

Relaxed relax(const Domain& domain, double h, const RelaxOptions& options = {},
              const FeatureSet& features = {}) {
    RunContext run;
    const UniformSizing sizing(h);
    Relaxed relaxed;
    const Particles seeds = seed_surface(domain, features, sizing, SeedOptions{}, run);
    relaxed.surface = relax_surface(seeds, domain, features, sizing, options, run);
    const Particles all =
        seed_volume(relaxed.surface.particles, domain, sizing, {}, SeedOptions{}, run);
    relaxed.volume = relax_volume(all, domain, sizing, options, run);
    return relaxed;
}

// Distance to the nearest other particle over h, for every particle of a kind.
std::vector<double> nearest(const Particles& particles, ParticleKind kind) {
    std::vector<double> distances;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (particles.kind[i] != kind) {
            continue;
        }
        double best = 1e300;
        for (std::size_t j = 0; j < particles.size(); ++j) {
            if (j != i) {
                best = std::min(best, (particles.position[i] - particles.position[j]).norm());
            }
        }
        distances.push_back(best / particles.h[i]);
    }
    std::sort(distances.begin(), distances.end());
    return distances;
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

TEST(NeighbourGridTest, FindsThePairsThatAllPairsFind) {
    Points points;
    std::vector<double> h;
    std::vector<Index> members;
    for (std::uint64_t i = 0; i < 600; ++i) {
        points.emplace_back(3.0 * hash_random(3, i, 0), hash_random(3, i, 1),
                            0.4 * hash_random(3, i, 2));
        h.push_back(0.03 * std::pow(8.0, hash_random(3, i, 3)));
        members.push_back(static_cast<Index>(i));
    }
    const NeighbourGrid grid(points, h, members, 1.5);

    for (std::size_t i = 0; i < points.size(); ++i) {
        std::vector<Index> fast;
        grid.visit(points[i], h[i], [&](Index j, double) { fast.push_back(j); });
        std::sort(fast.begin(), fast.end());
        std::vector<Index> slow;
        for (std::size_t j = 0; j < points.size(); ++j) {
            if ((points[i] - points[j]).norm() < 0.75 * (h[i] + h[j])) {
                slow.push_back(static_cast<Index>(j));
            }
        }
        EXPECT_EQ(fast, slow);
    }
}

TEST(RelaxSurface, SpreadsParticlesEvenlyOnTheBoundary) {
    const SphereDomain sphere(1.0);
    const RelaxResult result = relax(sphere, 0.08).surface;

    EXPECT_TRUE(result.converged);
    for (const Vec3& x : result.particles.position) {
        EXPECT_NEAR(x.norm(), 1.0, 1e-12);
    }
    const auto distances = nearest(result.particles, ParticleKind::Surface);
    EXPECT_GT(distances[distances.size() / 2], 0.93);
    EXPECT_GT(distances.front(), 0.75);
}

TEST(RelaxSurface, KeepsCornersAndCurves) {
    const BoxDomain box(Vec3(1.0, 1.0, 1.0));
    const Particles particles = relax(box, 0.13, {}, box.features()).surface.particles;

    const FeatureSet features = box.features();
    for (std::size_t i = 0; i < particles.size(); ++i) {
        const Vec3& x = particles.position[i];
        if (particles.kind[i] == ParticleKind::Corner) {
            EXPECT_EQ(x, features.corners[i]);
        } else if (particles.kind[i] == ParticleKind::Curve) {
            const auto& ends =
                features.curves[static_cast<std::size_t>(particles.anchor[i])].points;
            const double detour = (x - ends[0]).norm() + (x - ends[1]).norm() - 1.0;
            EXPECT_NEAR(detour, 0.0, 1e-12);
        }
    }
}

TEST(RelaxSurface, SpreadsACrowdOnACurve) {
    const BoxDomain box(Vec3(1.0, 1.0, 1.0));
    Particles particles;
    for (int i = 0; i < 9; ++i) {
        particles.add(Vec3(0.05 + 0.08 * i, 0, 0), ParticleKind::Curve, 0, 0.1, Vec3::UnitX());
    }
    particles.add(Vec3(0, 0, 0), ParticleKind::Corner, kNone, 0.1, Vec3::Zero());
    particles.add(Vec3(1, 0, 0), ParticleKind::Corner, kNone, 0.1, Vec3::Zero());
    RunContext run;
    const RelaxResult result =
        relax_surface(particles, box, box.features(), UniformSizing(0.1), RelaxOptions{}, run);

    for (std::size_t i = 0; i < 9; ++i) {
        EXPECT_NEAR(result.particles.position[i].x(), 0.1 * static_cast<double>(i + 1), 0.01);
    }
}

TEST(RelaxSurface, MergesParticlesThatLieTooClose) {
    const SphereDomain sphere(1.0);
    Particles particles;
    particles.add(Vec3(0, 0, 1), ParticleKind::Surface, 0, 0.1, Vec3::UnitZ());
    particles.add(Vec3(0.001, 0, 1).normalized(), ParticleKind::Surface, 0, 0.1, Vec3::UnitZ());
    RelaxOptions options;
    options.max_surface_iterations = 0;
    RunContext run;
    const auto kept =
        relax_surface(particles, sphere, {}, UniformSizing(0.1), options, run).particles;

    ASSERT_EQ(kept.size(), 1u);
    EXPECT_EQ(kept.position[0], Vec3(0, 0, 1));
}

TEST(RelaxVolume, NeverMovesAParticleOutside) {
    const BoxDomain plate(Vec3(1.0, 1.0, 0.12));
    const Particles particles = relax(plate, 0.1, {}, plate.features()).volume.particles;

    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (particles.kind[i] == ParticleKind::Volume) {
            EXPECT_LT(plate.signed_distance(particles.position[i]), -0.2 * 0.1);
        }
    }
}

TEST(RelaxVolume, MovesOnlyWhatIsNearTheBoundary) {
    const SphereDomain sphere(1.0);
    const UniformSizing sizing(0.1);
    RunContext run;
    const Particles seeds = seed_surface(sphere, {}, sizing, SeedOptions{}, run);
    const Particles before = seed_volume(seeds, sphere, sizing, {}, SeedOptions{}, run);
    const Particles after = relax_volume(before, sphere, sizing, RelaxOptions{}, run).particles;

    std::size_t moved = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
        const double depth = -sphere.signed_distance(before.position[i]);
        const bool has_moved = before.position[i] != after.position[i];
        moved += has_moved;
        if (before.kind[i] != ParticleKind::Volume || depth > 1.5 * 0.1) {
            EXPECT_FALSE(has_moved);
        }
    }
    EXPECT_GT(moved, 100u);
}

TEST(Relax, EveryForceLawAndIntegratorSpreadsTheParticles) {
    const SphereDomain sphere(1.0);
    for (const ForceLaw force : {ForceLaw::Springs, ForceLaw::ChargedParticles}) {
        for (const Integrator integrator :
             {Integrator::DampedDynamics, Integrator::GradientDescent, Integrator::Fire}) {
            const RelaxOptions options{.force = force, .integrator = integrator};
            const Relaxed relaxed = relax(sphere, 0.12, options);

            const auto distances = nearest(relaxed.surface.particles, ParticleKind::Surface);
            EXPECT_GT(distances[distances.size() / 2], 0.9)
                << static_cast<int>(force) << ' ' << static_cast<int>(integrator);
            EXPECT_LT(relaxed.volume.residual, 0.03)
                << static_cast<int>(force) << ' ' << static_cast<int>(integrator);
        }
    }
}

TEST(Relax, FollowsAGradedField) {
    const SphereDomain sphere(1.0);
    const auto source =
        std::make_shared<SampleSource>(std::vector<SizingSample>{{Vec3(0, 0, 1), 0.06}}, 0.3);
    const LipschitzField sizing({source}, 0.06, 0.12);
    RunContext run;
    const Particles seeds = seed_surface(sphere, {}, sizing, SeedOptions{}, run);
    const Particles surface =
        relax_surface(seeds, sphere, {}, sizing, RelaxOptions{}, run).particles;

    for (std::size_t i = 0; i < surface.size(); ++i) {
        EXPECT_DOUBLE_EQ(surface.h[i], sizing.h(surface.position[i]));
    }
    const auto distances = nearest(surface, ParticleKind::Surface);
    EXPECT_GT(distances.front(), 0.65);
    EXPECT_LT(distances.back(), 1.3);
}

TEST(Relax, SendsSamplesWhoseResidualFalls) {
    std::vector<ConvergenceSample> samples;
    RunContext run({}, [&](const RunEvent& event) {
        if (const auto* sample = std::get_if<ConvergenceSample>(&event)) {
            samples.push_back(*sample);
        }
    });
    const SphereDomain sphere(1.0);
    const UniformSizing sizing(0.1);
    const Particles seeds = seed_surface(sphere, {}, sizing, SeedOptions{}, run);
    const RelaxResult result = relax_surface(seeds, sphere, {}, sizing, RelaxOptions{}, run);

    ASSERT_EQ(samples.size(), static_cast<std::size_t>(result.iterations));
    EXPECT_LT(samples.back().residual_force, 0.1 * samples.front().residual_force);
    EXPECT_LT(samples.back().potential_energy, samples.front().potential_energy);
    EXPECT_GT(samples[3].kinetic_energy, 0.0);
}

TEST(Relax, GivesTheSameBytesOnAnyNumberOfThreads) {
    const TorusDomain torus(1.0, 0.4);
    Relaxed one;
    Relaxed four;
    tbb::task_arena(1).execute([&] { one = relax(torus, 0.07); });
    tbb::task_arena(4).execute([&] { four = relax(torus, 0.07); });

    EXPECT_EQ(one.volume.particles.position, four.volume.particles.position);
    EXPECT_EQ(one.surface.particles.anchor, four.surface.particles.anchor);
}

TEST(Relax, LeavesNothingToDoWithoutParticles) {
    RunContext run;
    const SphereDomain sphere(1.0);

    EXPECT_TRUE(relax_surface({}, sphere, {}, UniformSizing(0.1), RelaxOptions{}, run).converged);
    EXPECT_TRUE(relax_volume({}, sphere, UniformSizing(0.1), RelaxOptions{}, run).converged);
}

TEST(Relax, RefusesOptionsOutOfRange) {
    const auto refused = [](const RelaxOptions& options) {
        return code_of([&] { validate(options); }) == ErrorCode::InvalidInput;
    };

    EXPECT_TRUE(refused({.mass = 0.0}));
    EXPECT_TRUE(refused({.damping = 2.5}));
    EXPECT_TRUE(refused({.charge_exponent = 7.0}));
    EXPECT_TRUE(refused({.max_surface_iterations = -1}));
    EXPECT_TRUE(refused({.max_volume_iterations = -1}));
    EXPECT_TRUE(refused({.tolerance = 0.0}));
    EXPECT_TRUE(refused({.active_depth = std::nan("")}));
}

TEST(Relax, StopsInTheMiddleWhenAsked) {
    std::stop_source stop;
    RunContext run(stop.get_token(), [&](const RunEvent& event) {
        if (const auto* sample = std::get_if<ConvergenceSample>(&event); sample != nullptr) {
            if (sample->iteration == 5) {
                stop.request_stop();
            }
        }
    });
    const SphereDomain sphere(1.0);
    const UniformSizing sizing(0.1);
    const Particles seeds = seed_surface(sphere, {}, sizing, SeedOptions{}, run);

    EXPECT_EQ(code_of([&] { relax_surface(seeds, sphere, {}, sizing, RelaxOptions{}, run); }),
              ErrorCode::Cancelled);
}

}  // namespace
}  // namespace remesh::testing
