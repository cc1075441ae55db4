// The paper's reaction-diffusion of the refinement map.

#include "core/stages/sizing/diffusion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/geometry/spatial_hash.h"
#include "core/stages/populate.h"
#include "core/stages/relax.h"
#include "core/stages/seed.h"
#include "core/stages/sizing.h"
#include "core/stages/sizing/diffused_map.h"
#include "core/stages/tetrahedralize.h"
#include "tests/support/analytic_domain.h"

namespace remesh::testing {
namespace {

using ::testing::HasSubstr;

constexpr double kForever = std::numeric_limits<double>::infinity();

// A bar of n cubes from x = 0, each of edge 1 and cut into six tets; z runs along it last.
struct Bar {
    Points points{};
    std::vector<Tet> tets{};

    explicit Bar(Index n) {
        for (Index x = 0; x <= n; ++x) {
            for (const Index y : {0, 1}) {
                for (const Index z : {0, 1}) {
                    points.emplace_back(x, y, z);
                }
            }
        }
        // Kuhn's tets: each way from one corner of the cube to the opposite one, axis by axis.
        for (Index x = 0; x < n; ++x) {
            const Index corner = 4 * x;
            for (const auto& [a, b, c] :
                 {std::array{4, 2, 1}, {2, 1, 4}, {1, 4, 2}, {2, 4, 1}, {4, 1, 2}, {1, 2, 4}}) {
                Tet tet{corner, corner + a, corner + a + b, corner + a + b + c};
                const auto at = [&](std::size_t k) {
                    return points[static_cast<std::size_t>(tet[k])];
                };
                if ((at(1) - at(0)).dot((at(2) - at(0)).cross(at(3) - at(0))) < 0.0) {
                    std::swap(tet[2], tet[3]);
                }
                tets.push_back(tet);
            }
        }
    }

    // 1 where x = 0, which is held.
    [[nodiscard]] std::vector<double> after(double reaction, double time) const {
        std::vector<double> c(points.size(), 0.0);
        std::vector<char> is_fixed(points.size(), 0);
        for (std::size_t i = 0; i < 4; ++i) {
            c[i] = 1.0;
            is_fixed[i] = 1;
        }
        return diffuse(points, tets, c, is_fixed, {.reaction = reaction, .time = time},
                       RunContext());
    }
};

TEST(Diffusion, FallsOffAsTheHyperbolicCosineOnceItIsSteady) {
    const Index n = 40;
    const double reaction = -1.0 / 64.0;
    const Bar bar(n);

    const auto c = bar.after(reaction, kForever);

    for (std::size_t i = 0; i < c.size(); ++i) {
        const double x = bar.points[i].x();
        EXPECT_NEAR(c[i], std::cosh((n - x) / 8.0) / std::cosh(n / 8.0), 1e-3) << x;
    }
}

TEST(Diffusion, TakesAnImplicitStepThatIsTheSteadyStateOfAStrongerReaction) {
    // From c = 0, (1 / time - R) c = div grad c.
    const Bar bar(20);

    const auto step = bar.after(-0.02, 25.0);
    const auto steady = bar.after(-0.06, kForever);

    for (std::size_t i = 0; i < step.size(); ++i) {
        EXPECT_NEAR(step[i], steady[i], 1e-6);
    }
}

TEST(Diffusion, LeavesAloneWhatIsInNoTetOrInFlatOnes) {
    const Points points{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 1e-9), Vec3(0, 1, 0),
                        Vec3(9, 9, 9)};
    const std::vector<double> c{0.1, 0.2, 0.3, 0.4, 0.5};

    const auto after =
        diffuse(points, {{0, 1, 2, 3}}, c, {1, 0, 0, 0, 0}, {.reaction = -1.0}, RunContext());

    EXPECT_EQ(after, c);
}

TEST(Diffusion, StopsWhenItIsToldTo) {
    std::stop_source stop;
    stop.request_stop();
    const Bar bar(2);

    EXPECT_THROW(diffuse(bar.points, bar.tets, std::vector<double>(bar.points.size()),
                         std::vector<char>(bar.points.size()), {.reaction = -1.0},
                         RunContext(stop.get_token())),
                 Error);
}

TEST(ReactionFor, MakesAFlatWallsMapAsSteepAsTheGradation) {
    for (const double h_min : {0.1, 0.3, 0.6, 0.9}) {
        const double length = 1.0 / std::sqrt(-reaction_for(h_min, 1.0, 0.2));
        double steepest = 0.0;
        for (double d = 0.0; d < 10.0; d += 0.001) {
            const double c = std::log(1.0 / h_min) * std::exp(-d / length);
            steepest = std::max(steepest, std::exp(-c) * c / length);
        }
        EXPECT_NEAR(steepest, 0.2, 1e-3) << h_min;
    }
}

// A ball of radius 1 whose curvature asks for 0.1 on the surface; 0.5 is the largest size.
SizingOptions by_curvature(Propagation propagation) {
    return {.guard_thickness = false, .propagation = propagation, .chord_error = 0.1 * 0.1 / 8.0};
}

SizingMap map_of(const Domain& domain, const SizingOptions& options) {
    RunContext run;
    return build_sizing_field(domain, {}, 0.5, options, run);
}

Vec3 random_point(std::uint64_t i) {
    return 2.0 * Vec3(hash_random(7, i, 0), hash_random(7, i, 1), hash_random(7, i, 2)) -
           Vec3::Ones();
}

// The steady state in a ball is c0 / r sinh(r / length) / sinh(1 / length).
void expect_steady_in_the_ball(const SizingField& field) {
    const double length = 1.0 / std::sqrt(-reaction_for(0.1, 0.5, 0.2));
    for (const double r : {0.1, 0.3, 0.5, 0.7, 0.9}) {
        const double c = std::log(5.0) / r * std::sinh(r / length) / std::sinh(1.0 / length);
        EXPECT_NEAR(field.h(r * Vec3(0.36, 0.48, 0.8)), 0.5 * std::exp(-c), 0.008) << r;
    }
}

void expect_graded_and_finer(const SizingField& field, const SizingField& coarsest) {
    for (std::uint64_t i = 0; i < 2000; ++i) {
        const Vec3 x = random_point(i);
        const Vec3 y = x + 0.1 * random_point(5000 + i);
        EXPECT_LE(field.h(x), coarsest.h(x) + 1e-12);
        EXPECT_GE(field.h(x), field.h_min());
        EXPECT_LE(std::abs(field.h(x) - field.h(y)), (0.2 + 1e-9) * (x - y).norm());
    }
}

TEST(SpreadOnCoarseMesh, ReachesTheSteadyStateInABall) {
    const SphereDomain ball(1.0);

    const auto field = map_of(ball, by_curvature(Propagation::Multigrid)).field;

    expect_steady_in_the_ball(*field);
    expect_graded_and_finer(*field, *map_of(ball, by_curvature(Propagation::Lipschitz)).field);
}

TEST(SpreadOnCoarseMesh, HoldsWhatIsAskedForInTheVolume) {
    // Slow decay: what is asked for in the middle fills the gap to the surface.
    const SphereDomain ball(2.0);
    SizingOptions options{
        .guard_thickness = false, .propagation = Propagation::Multigrid, .reaction = -1e-4};
    options.regions = {{SizingSphere{Vec3::Zero(), 0.5}, 0.1, {}},
                       {SizingSphere{Vec3(0.0, 0.0, 3.0), 1.2}, 0.1, {}}};

    const auto field = map_of(ball, options).field;

    EXPECT_EQ(field->h(Vec3(0.0, 0.0, 0.4)), 0.1);
    EXPECT_LT(field->h(Vec3(0.0, 0.0, 1.1)), 0.19);  // 0.22 by the gradation.
}

TEST(CoupledSizing, ComesToTheSteadyStateWithItsParticles) {
    const SphereDomain ball(1.0);
    const SizingMap map = map_of(ball, by_curvature(Propagation::Coupled));
    const auto coarsest = map_of(ball, by_curvature(Propagation::Lipschitz)).field;
    ASSERT_NE(map.coupled, nullptr);
    EXPECT_EQ(map.field->h(Vec3::Zero()), coarsest->h(Vec3::Zero()));
    RunContext run;
    Particles particles = seed_surface(ball, {}, *map.field, {}, run);
    particles = seed_volume(particles, ball, *map.field, {}, {}, run);
    const std::size_t before = particles.size();

    for (int cycle = 0; cycle < 6; ++cycle) {
        const TetComplex delaunay = tetrahedralize(particles.position, run);
        map.coupled->diffuse(particles, delaunay, ball, run);
        auto populated = control_population(particles, delaunay, ball, *map.field, run);
        map.coupled->repopulate(populated.origin);
        particles = relax_volume(populated.particles, ball, *map.field, {}, run).particles;
    }

    EXPECT_GT(particles.size(), before);
    expect_steady_in_the_ball(*map.field);
    expect_graded_and_finer(*map.field, *coarsest);
}

TEST(BuildSizingField, IsUniformWhereNothingThatCouldDiffuseIsAskedFor) {
    const BoxDomain box(Vec3(4, 4, 4));
    for (const auto propagation : {Propagation::Multigrid, Propagation::Coupled}) {
        SizingOptions options{.guard_thickness = false, .propagation = propagation};
        options.regions = {{SizingSphere{Vec3(2, 2, 2), 1.0}, 0.5, {}}};

        EXPECT_TRUE(map_of(box, options).field->is_uniform());
        EXPECT_EQ(map_of(box, options).coupled, nullptr);
    }
}

TEST(CoupledSizing, KeepsToTheGrowthThatALayerAsksFor) {
    const SphereDomain ball(2.0);
    SizingOptions options{.guard_thickness = false, .propagation = Propagation::Multigrid};
    options.layer = BoundaryLayer{.first_size = 0.1, .growth = 1.25};

    const auto field = map_of(ball, options).field;

    EXPECT_NEAR(field->h(Vec3::Zero()), 0.5, 1e-9);
    EXPECT_NEAR(field->h(Vec3(1.0, 0.0, 0.0)), 0.1 + 0.25 / 0.85, 1e-9);
}

TEST(ValidateSizing, RefusesAReactionThatHasNoSteadyState) {
    const auto refusal = [](Propagation propagation, double reaction) -> std::string {
        try {
            validate(SizingOptions{.propagation = propagation, .reaction = reaction});
        } catch (const Error& error) {
            return error.what();
        }
        return "";
    };

    EXPECT_THAT(refusal(Propagation::Coupled, 0.5), HasSubstr("sizing.reaction must be < 0"));
    EXPECT_THAT(refusal(Propagation::Multigrid, 0.0), HasSubstr("got 0"));
    EXPECT_THAT(refusal(Propagation::Multigrid, -kForever), HasSubstr("must be < 0"));
    EXPECT_THAT(refusal(Propagation::Lipschitz, -1.0), HasSubstr("must be absent where"));
    EXPECT_EQ(refusal(Propagation::Multigrid, -1.0), "");
}

}  // namespace
}  // namespace remesh::testing
