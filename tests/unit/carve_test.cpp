#include "core/stages/carve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <stop_token>

#include "core/error.h"
#include "core/stages/manifold_labels.h"
#include "core/stages/tetrahedralize.h"
#include "core/stages/verify.h"
#include "tests/support/analytic_domain.h"
#include "tests/support/manifold.h"

namespace remesh::testing {
namespace {

using ::testing::HasSubstr;

// A body given by its signed distance, or by anything with its sign.
class ImplicitDomain final : public AnalyticDomain {
public:
    using Value = std::function<double(const Vec3&)>;

    explicit ImplicitDomain(Value value)
        : AnalyticDomain({.vertices = {Vec3::Constant(-100.0), Vec3::Constant(100.0)}}),
          value_(std::move(value)) {}

    [[nodiscard]] BoundaryPoint closest(const Vec3& point, Index /*hint*/) const override {
        return {.point = point, .distance = std::abs(value_(point))};
    }
    [[nodiscard]] double signed_distance(const Vec3& point) const override { return value_(point); }

private:
    Value value_;
};

class Random {
public:
    explicit Random(unsigned seed) : engine_(seed) {}

    double uniform(double low, double high) {
        return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0;
    }
    Vec3 in_cube(double half) {
        const double x = uniform(-half, half);
        const double y = uniform(-half, half);
        return {x, y, uniform(-half, half)};
    }

private:
    std::mt19937 engine_;
};

void add(Particles& particles, const Vec3& x, ParticleKind kind, double h = 1.0) {
    particles.add(x, kind, kNone, h, Vec3::Zero());
}

// Surface particles about h = 1 apart on a sphere, and a jittered grid inside.
void add_ball(Particles& particles, const Vec3& center, double radius, unsigned seed) {
    const int count = static_cast<int>(4.0 * std::numbers::pi * radius * radius / 0.87);
    for (int i = 0; i < count; ++i) {
        const double z = 1.0 - 2.0 * (i + 0.5) / count;
        const double r = std::sqrt(1.0 - z * z);
        const double angle = 2.399963 * i;
        add(particles, center + radius * Vec3(r * std::cos(angle), r * std::sin(angle), z),
            ParticleKind::Surface);
    }
    Random random(seed);
    const int n = static_cast<int>(radius) + 1;
    for (int x = -n; x <= n; ++x) {
        for (int y = -n; y <= n; ++y) {
            for (int z = -n; z <= n; ++z) {
                const Vec3 point = Vec3(x, y, z) * 0.9 + random.in_cube(0.15);
                if (point.norm() < radius - 0.5) {
                    add(particles, center + point, ParticleKind::Volume);
                }
            }
        }
    }
}

Particles ball(double radius) {
    Particles particles;
    add_ball(particles, Vec3::Zero(), radius, 1);
    return particles;
}

CarveResult carve(const Particles& particles, const Domain& domain,
                  const CarveOptions& options = {}) {
    RunContext run;
    return carve_domain(particles, tetrahedralize(particles.position, run), domain, options, run);
}

double volume_of(const TetMesh& mesh) {
    double sum = 0.0;
    for (const auto& t : mesh.tets) {
        const Vec3& a = mesh.vertices[t[0]];
        sum += (mesh.vertices[t[1]] - a)
                   .dot((mesh.vertices[t[2]] - a).cross(mesh.vertices[t[3]] - a)) /
               6.0;
    }
    return sum;
}

// What must hold whatever comes in.
void expect_sound(const CarveResult& result) {
    const auto boundary = boundary_of(result.mesh.tets);
    EXPECT_EQ(manifold_fault(boundary), "");
    EXPECT_EQ(check_tets(result.mesh, RunContext()).summary(), "no faults");

    std::vector<bool> is_on_boundary(result.mesh.vertices.size(), false);
    for (const auto& triangle : boundary) {
        for (const Index v : triangle) {
            is_on_boundary[static_cast<std::size_t>(v)] = true;
        }
    }
    for (std::size_t v = 0; v < is_on_boundary.size(); ++v) {
        ASSERT_EQ(is_on_boundary[v], result.kind[v] != ParticleKind::Volume);
    }
}

TEST(CarveDomain, FillsABall) {
    const double radius = 6.0;

    const auto result = carve(ball(radius), SphereDomain(radius));

    expect_sound(result);
    const double sphere = 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3);
    EXPECT_NEAR(volume_of(result.mesh) / sphere, 1.0, 0.03);
    EXPECT_EQ(result.forced_steps, 0);
    EXPECT_EQ(result.dropped_parts, 0);
}

TEST(CarveDomain, KeepsAllParticlesAsVerticesAndTheOrderOfTheTets) {
    const auto particles = ball(4.0);

    const auto result = carve(particles, SphereDomain(4.0));

    EXPECT_EQ(result.mesh.vertices, particles.position);
    EXPECT_EQ(result.kind.size(), particles.size());
    EXPECT_TRUE(std::is_sorted(result.mesh.tets.begin(), result.mesh.tets.end()));
}

TEST(CarveDomain, LeavesTheHoleOfATorusOpen) {
    const TorusDomain torus(6.0, 2.0);
    Particles particles;
    Random random(2);
    for (int i = 0; i < 44; ++i) {
        for (int j = 0; j < 14; ++j) {
            const double around =
                2.0 * std::numbers::pi * (i + 0.5 * (j % 2) + random.uniform(0.0, 0.2)) / 44;
            const double across = 2.0 * std::numbers::pi * (j + random.uniform(0.0, 0.2)) / 14;
            for (const double r : {2.0, 1.0}) {
                if (r == 2.0 || j % 2 == 0) {
                    const double rho = 6.0 + r * std::cos(across);
                    add(particles,
                        {rho * std::cos(around), rho * std::sin(around), r * std::sin(across)},
                        r == 2.0 ? ParticleKind::Surface : ParticleKind::Volume);
                }
            }
        }
        const double around = 2.0 * std::numbers::pi * i / 44;
        add(particles, {6.0 * std::cos(around), 6.0 * std::sin(around), 0.0}, ParticleKind::Volume);
    }

    const auto result = carve(particles, torus);

    expect_sound(result);
    const auto surface = boundary_surface(result.mesh);
    const auto corners = static_cast<std::int64_t>(surface.vertices.size());
    const auto triangles = static_cast<std::int64_t>(surface.triangles.size());
    EXPECT_EQ(corners - triangles / 2, 0);  // Euler characteristic.
    const double volume = 2.0 * std::numbers::pi * std::numbers::pi * 6.0 * 4.0;
    EXPECT_NEAR(volume_of(result.mesh) / volume, 1.0, 0.05);
}

TEST(CarveDomain, RelabelsVerticesByWhetherTheyAreOnTheBoundary) {
    auto particles = ball(4.0);
    const auto count = particles.size();
    add(particles, Vec3(0.01, 0.02, 0.03), ParticleKind::Surface);
    add(particles, Vec3(0.0, 0.0, 30.0), ParticleKind::Corner);
    particles.kind[0] = ParticleKind::Corner;
    particles.kind[1] = ParticleKind::Volume;

    const auto result = carve(particles, SphereDomain(4.0));

    expect_sound(result);
    EXPECT_EQ(result.kind[count], ParticleKind::Volume);
    EXPECT_EQ(result.kind[count + 1], ParticleKind::Volume);
    EXPECT_EQ(result.kind[0], ParticleKind::Corner);
    EXPECT_EQ(result.kind[1], ParticleKind::Surface);
}

TEST(CarveDomain, DropsSmallParts) {
    auto particles = ball(5.0);
    add_ball(particles, Vec3(9.0, 0.0, 0.0), 0.9, 2);
    const ImplicitDomain two([](const Vec3& x) {
        return std::min(x.norm() - 5.0, (x - Vec3(9.0, 0.0, 0.0)).norm() - 0.9);
    });

    const auto dropped = carve(particles, two);
    const auto kept = carve(particles, two, {.min_part_volume = 0.0});

    expect_sound(dropped);
    expect_sound(kept);
    EXPECT_EQ(dropped.dropped_parts, 1);
    EXPECT_EQ(kept.dropped_parts, 0);
    EXPECT_GT(volume_of(kept.mesh), volume_of(dropped.mesh) + 0.5);
}

TEST(CarveDomain, KeepsTheLargestPartHoweverSmall) {
    auto particles = ball(0.9);

    const auto result = carve(particles, SphereDomain(0.9), {.min_part_volume = 1000.0});

    expect_sound(result);
    EXPECT_EQ(result.dropped_parts, 0);
    EXPECT_GT(volume_of(result.mesh), 0.5);
}

TEST(CarveDomain, DropsPartsBelowAShareOfTheLargestAndTellsWhere) {
    const Vec3 middle(9.0, 0.0, 0.0);
    auto particles = ball(5.0);
    add_ball(particles, middle, 1.5, 2);
    const ImplicitDomain two(
        [&](const Vec3& x) { return std::min(x.norm() - 5.0, (x - middle).norm() - 1.5); });

    const auto kept = carve(particles, two, {.min_part_share = 1e-3});
    const auto dropped = carve(particles, two, {.min_part_share = 0.1});

    EXPECT_EQ(kept.notable_parts, 0);
    EXPECT_EQ(dropped.notable_parts, 1);
    ASSERT_TRUE(dropped.notable_part);
    EXPECT_LT((*dropped.notable_part - middle).norm(), 1.5);
}

TEST(CarveDomain, FillsSmallVoids) {
    auto particles = ball(5.0);
    for (std::size_t i = 0; i < particles.size(); ++i) {
        const double radius = particles.position[i].norm();
        if (radius < 1.3) {
            particles.position[i] *= 0.9 / radius;
            particles.kind[i] = ParticleKind::Surface;
        }
    }
    const ImplicitDomain hollow(
        [](const Vec3& x) { return std::max(x.norm() - 5.0, 0.9 - x.norm()); });

    const auto filled = carve(particles, hollow, {.max_void_volume = 50.0});
    const auto kept = carve(particles, hollow, {.max_void_volume = 0.0});

    expect_sound(filled);
    expect_sound(kept);
    EXPECT_GE(filled.filled_voids, 1);
    EXPECT_EQ(kept.filled_voids, 0);
    EXPECT_GT(volume_of(filled.mesh), volume_of(kept.mesh));
}

TEST(CarveDomain, StaysManifoldWhereSpheresNearlyTouch) {
    for (const double gap : {-0.3, 0.0, 0.05, 0.2, 0.5}) {
        const Vec3 center(8.0 + gap, 0.0, 0.0);
        Particles particles;
        add_ball(particles, Vec3::Zero(), 4.0, 4);
        add_ball(particles, center, 4.0, 5);
        const ImplicitDomain two(
            [&](const Vec3& x) { return std::min(x.norm() - 4.0, (x - center).norm() - 4.0); });

        const auto result = carve(particles, two);

        expect_sound(result);
        EXPECT_NEAR(volume_of(result.mesh), 2.0 * 268.1, 40.0) << "gap " << gap;
    }
}

TEST(CarveDomain, StaysManifoldInAThinSlab) {
    for (unsigned seed = 0; seed < 10; ++seed) {
        Random random(seed);
        const double thickness = 0.5 + 0.1 * seed;
        Particles particles;
        for (int x = 0; x < 15; ++x) {
            for (int y = 0; y < 15; ++y) {
                for (const double z : {0.0, thickness}) {
                    add(particles,
                        {x + random.uniform(-0.3, 0.3), y + random.uniform(-0.3, 0.3), z},
                        ParticleKind::Surface);
                }
            }
        }
        const BoxDomain slab(Vec3(14.0, 14.0, thickness));

        expect_sound(carve(particles, slab));
    }
}

// Particles of any kind anywhere, and a domain that has nothing to do with them.
CarveResult carve_garbage(unsigned seed) {
    Random random(seed);
    Particles particles;
    const int count = 20 + static_cast<int>(random.uniform(0.0, 600.0));
    const double surface_share = random.uniform(0.3, 1.0);
    const double spacing = random.uniform(0.3, 3.0);
    for (int i = 0; i < count; ++i) {
        const bool is_surface = random.uniform(0.0, 1.0) < surface_share;
        add(particles, random.in_cube(4.0),
            is_surface ? ParticleKind::Surface : ParticleKind::Volume, spacing);
    }
    const double frequency = random.uniform(0.3, 4.0);
    const ImplicitDomain waves([=](const Vec3& x) {
        return std::sin(frequency * x.x()) + std::sin(frequency * x.y()) +
               std::sin(frequency * x.z()) - 0.3;
    });
    return carve(particles, waves, {.min_part_volume = 0.0, .max_void_volume = 0.0});
}

class CarveGarbage : public ::testing::TestWithParam<unsigned> {};

TEST_P(CarveGarbage, EndsManifoldOrUnmeshable) {
    try {
        expect_sound(carve_garbage(GetParam()));
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Unmeshable);
    }
}

INSTANTIATE_TEST_SUITE_P(Seeds, CarveGarbage, ::testing::Range(0U, 60U));

TEST(ManifoldLabels, EndManifoldFromAnyLabels) {
    for (unsigned seed = 0; seed < 30; ++seed) {
        Random random(seed);
        Points points;
        for (int i = 0; i < 150; ++i) {
            points.push_back(random.in_cube(1.0));
        }
        RunContext run;
        const auto complex = tetrahedralize(points, run);
        std::vector<std::uint8_t> inside(complex.tets.size());
        std::generate(inside.begin(), inside.end(),
                      [&] { return static_cast<std::uint8_t>(random.uniform(0.0, 2.0)); });
        const auto kept = [&](Index t) {
            return SwitchCost{.harm = 0.01F, .keep = t % 5 == 0, .may_enter = t % 3 != 0};
        };

        ManifoldLabels labels(complex, points.size(), inside, kept, run);
        EXPECT_GT(labels.bad_vertices(), 0);
        labels.switch_greedily();
        labels.remove_until_manifold();

        EXPECT_EQ(labels.bad_vertices(), 0);
        std::vector<Tet> tets;
        for (std::size_t t = 0; t < complex.tets.size(); ++t) {
            if (labels.inside()[t] != 0) {
                tets.push_back(complex.tets[t]);
            }
        }
        EXPECT_EQ(manifold_fault(boundary_of(tets)), "") << "seed " << seed;
    }
}

TEST(ManifoldLabels, LeaveAManifoldBoundaryAlone) {
    RunContext run;
    const auto complex = tetrahedralize(ball(4.0).position, run);
    const std::vector<std::uint8_t> all(complex.tets.size(), 1);

    ManifoldLabels labels(
        complex, ball(4.0).size(), all, [](Index) { return SwitchCost{}; }, run);
    labels.switch_greedily();
    labels.remove_until_manifold();

    EXPECT_EQ(labels.switches(), 0);
    EXPECT_EQ(labels.forced_steps(), 0);
    EXPECT_EQ(labels.inside(), all);
}

TEST(CarveDomain, GivesTheSameMeshOnAnyNumberOfThreads) {
    const auto on = [](int threads) {
        tbb::task_arena arena(threads);
        return arena.execute([] { return carve_garbage(3); });
    };
    const auto expected = on(1);

    for (const int threads : {2, 3, 8}) {
        const auto actual = on(threads);
        EXPECT_EQ(actual.mesh.tets, expected.mesh.tets) << threads << " threads";
        EXPECT_EQ(actual.kind, expected.kind) << threads << " threads";
    }
}

TEST(CarveDomain, FailsIfNothingLiesInside) {
    const ImplicitDomain nothing([](const Vec3&) { return 1.0; });
    Particles particles;
    Random random(6);
    for (int i = 0; i < 50; ++i) {
        add(particles, random.in_cube(3.0), ParticleKind::Surface);
    }

    try {
        carve(particles, nothing);
        FAIL() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Unmeshable);
        EXPECT_THAT(error.what(), HasSubstr("lies inside the body"));
    }
}

TEST(CarveDomain, RefusesOptionsOutOfRange) {
    for (const double bad : {-1.0, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
        EXPECT_THROW(validate(CarveOptions{.min_part_volume = bad}), Error);
        EXPECT_THROW(validate(CarveOptions{.max_void_volume = bad}), Error);
        EXPECT_THROW(validate(CarveOptions{.min_part_share = bad}), Error);
    }
    EXPECT_NO_THROW(validate(CarveOptions{}));
    try {
        carve(ball(3.0), SphereDomain(3.0), {.min_part_volume = -2.0});
        FAIL() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::InvalidInput);
        EXPECT_THAT(error.what(), HasSubstr("carve.min_part_volume must be at least 0"));
    }
}

TEST(CarveDomain, StopsWhenAsked) {
    RunContext run;
    const auto particles = ball(3.0);
    const auto delaunay = tetrahedralize(particles.position, run);
    std::stop_source source;
    source.request_stop();
    RunContext stopped(source.get_token());

    try {
        carve_domain(particles, delaunay, SphereDomain(3.0), {}, stopped);
        FAIL() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Cancelled);
    }
}

}  // namespace
}  // namespace remesh::testing
