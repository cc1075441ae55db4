#include "core/stages/improve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <stop_token>

#include "core/error.h"
#include "core/stages/improve/flips.h"
#include "core/stages/report.h"
#include "core/stages/tetrahedralize.h"
#include "core/stages/verify.h"
#include "tests/support/analytic_domain.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

using ::testing::HasSubstr;

std::size_t at(Index i) {
    return static_cast<std::size_t>(i);
}

// A hash in [-1, 1], so that test points are irregular but the same everywhere.
double noise(std::uint64_t seed) {
    seed = (seed + 0x9E3779B97F4A7C15U) * 0xBF58476D1CE4E5B9U;
    seed = (seed ^ (seed >> 27)) * 0x94D049BB133111EBU;
    return static_cast<double>(seed >> 11) / static_cast<double>(std::uint64_t{1} << 52) - 1.0;
}

struct Carved {
    CarveResult result{};
    std::vector<Index> anchor{};
};

// Delaunay tets of a jittered lattice inside a body and of given points on its boundary, with
// slivers as they come.
Carved fill(Points boundary, std::vector<ParticleKind> kind, std::vector<Index> anchor,
            const testing::AnalyticDomain& domain, double h) {
    Carved carved;
    Points points = std::move(boundary);
    const Box box = domain.bounds();
    std::uint64_t id = 0;
    for (double z = box.low.z(); z < box.high.z(); z += h) {
        for (double y = box.low.y(); y < box.high.y(); y += h) {
            for (double x = box.low.x(); x < box.high.x(); x += h) {
                const Vec3 jitter(noise(id), noise(id + 1), noise(id + 2));
                id += 3;
                const Vec3 p = Vec3(x, y, z) + 0.2 * h * jitter;
                if (domain.signed_distance(p) < -0.5 * h) {
                    points.push_back(p);
                }
            }
        }
    }
    kind.resize(points.size(), ParticleKind::Volume);
    anchor.resize(points.size(), kNone);
    RunContext run;
    carved.result.mesh.vertices = points;
    for (const auto& tet : tetrahedralize(points, run).tets) {
        Vec3 centroid = Vec3::Zero();
        for (const Index v : tet) {
            centroid += 0.25 * points[at(v)];
        }
        const bool is_flat =
            std::all_of(tet.begin(), tet.end(),
                        [&](Index v) { return kind[at(v)] != ParticleKind::Volume; }) &&
            domain.signed_distance(centroid) > -0.05 * h;
        if (!is_flat) {
            carved.result.mesh.tets.push_back(tet);
        }
    }
    carved.result.kind = std::move(kind);
    carved.anchor = std::move(anchor);
    return carved;
}

constexpr double kSphereSpacing = 0.16;

Carved carved_sphere() {
    constexpr int kCount = 560;
    Points points;
    for (int i = 0; i < kCount; ++i) {
        const double z = 1.0 - (2.0 * i + 1.0) / kCount;
        const double turn = i * std::numbers::pi * (3.0 - std::sqrt(5.0));
        const double r = std::sqrt(1.0 - z * z);
        const auto seed = static_cast<std::uint64_t>(i);
        const Vec3 jitter(noise(3 * seed), noise(3 * seed + 1), noise(3 * seed + 2));
        points.push_back(
            (Vec3(r * std::cos(turn), r * std::sin(turn), z) + 0.03 * jitter).normalized());
    }
    return fill(points, std::vector(points.size(), ParticleKind::Surface),
                std::vector<Index>(points.size(), kNone), testing::SphereDomain(1.0),
                kSphereSpacing);
}

constexpr double kBoxSpacing = 0.125;

// Its edges are curves and its corners are corners.
Carved carved_box(const testing::BoxDomain& domain) {
    const FeatureSet features = domain.features();
    Points points = features.corners;
    std::vector<ParticleKind> kind(points.size(), ParticleKind::Corner);
    std::vector<Index> anchor(points.size(), kNone);
    constexpr int kCells = 8;
    for (std::size_t c = 0; c < features.curves.size(); ++c) {
        const auto& ends = features.curves[c].points;
        for (int i = 1; i < kCells; ++i) {
            const double t = (i + 0.2 * noise(100 * c + static_cast<std::size_t>(i))) / kCells;
            points.push_back(ends.front() + t * (ends.back() - ends.front()));
            kind.push_back(ParticleKind::Curve);
            anchor.push_back(static_cast<Index>(c));
        }
    }
    for (int face = 0; face < 6; ++face) {
        for (int i = 1; i < kCells; ++i) {
            for (int j = 1; j < kCells; ++j) {
                const auto seed = static_cast<std::uint64_t>(10'000 * face + 100 * i + j);
                Vec3 p = Vec3::Constant(face % 2);
                p[(face / 2 + 1) % 3] = (i + 0.2 * noise(2 * seed)) / kCells;
                p[(face / 2 + 2) % 3] = (j + 0.2 * noise(2 * seed + 1)) / kCells;
                points.push_back(p);
                kind.push_back(ParticleKind::Surface);
                anchor.push_back(kNone);
            }
        }
    }
    return fill(points, kind, anchor, domain, kBoxSpacing);
}

double worst_dihedral_sine(const TetMesh& mesh) {
    double worst = 1.0;
    for (const auto& tet : mesh.tets) {
        std::array<Vec3, 4> normal;
        for (std::size_t i = 0; i < 4; ++i) {
            const Vec3& a = mesh.vertices[at(tet[(i + 1) % 4])];
            const Vec3& b = mesh.vertices[at(tet[(i + 2) % 4])];
            const Vec3& c = mesh.vertices[at(tet[(i + 3) % 4])];
            normal[i] = (b - a).cross(c - a).normalized();
        }
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = i + 1; j < 4; ++j) {
                worst = std::min(worst, normal[i].cross(normal[j]).norm());
            }
        }
    }
    return worst;
}

double volume(const TetMesh& mesh) {
    double sum = 0.0;
    for (const auto& t : mesh.tets) {
        const Vec3& a = mesh.vertices[at(t[0])];
        sum += (mesh.vertices[at(t[1])] - a)
                   .dot((mesh.vertices[at(t[2])] - a).cross(mesh.vertices[at(t[3])] - a)) /
               6.0;
    }
    return sum;
}

ImproveResult improve_sphere(const ImproveOptions& options = {}, Aim aim = Aim::Body) {
    const auto carved = carved_sphere();
    RunContext run;
    return improve_mesh(carved.result, carved.anchor, testing::SphereDomain(1.0), {}, options, run,
                        aim);
}

Points core_of(const TetMesh& sphere) {
    Points core;
    std::copy_if(sphere.vertices.begin(), sphere.vertices.end(), std::back_inserter(core),
                 [](const Vec3& p) { return p.norm() < 0.5; });
    return core;
}

TEST(ImproveMesh, RaisesTheWorstDihedralOfASphereAboveTwentyDegrees) {
    const double before = worst_dihedral_sine(carved_sphere().result.mesh);

    const auto improved = improve_sphere();

    EXPECT_LT(before, std::sin(10.0 * std::numbers::pi / 180.0));
    EXPECT_GT(worst_dihedral_sine(improved.mesh), std::sin(20.0 * std::numbers::pi / 180.0));
    EXPECT_GT(improved.flips, 0);
}

TEST(ImproveMesh, LeavesAValidMesh) {
    const RunContext run;

    const Faults faults = check_tets(improve_sphere().mesh, run);

    EXPECT_FALSE(faults.any()) << faults.summary();
}

TEST(ImproveMesh, KeepsTheVolumeOfASphereWithinOnePercent) {
    const double before = volume(carved_sphere().result.mesh);

    EXPECT_NEAR(volume(improve_sphere().mesh), before, 0.01 * before);
}

TEST(ImproveMesh, KeepsSurfaceVerticesOnTheSphere) {
    const auto improved = improve_sphere();

    for (std::size_t v = 0; v < improved.kind.size(); ++v) {
        if (improved.kind[v] == ParticleKind::Surface) {
            ASSERT_NEAR(improved.mesh.vertices[v].norm(), 1.0, 1e-12) << "vertex " << v;
        }
    }
}

TEST(ImproveMesh, LeavesTheCoreAloneWhereOnlyTheSurfaceIsWanted) {
    const Points before = core_of(carved_sphere().result.mesh);
    ASSERT_GT(before.size(), 50U);

    EXPECT_EQ(core_of(improve_sphere({}, Aim::Surface).mesh), before);
    EXPECT_NE(core_of(improve_sphere({}, Aim::Body).mesh), before);
}

TEST(ImproveMesh, MakesTheSurfaceAloneAsGoodAsThatOfABody) {
    const RunContext run;
    const auto alone = improve_sphere({}, Aim::Surface);

    const auto body = measure_surface(boundary_surface(improve_sphere().mesh));
    const auto surface = measure_surface(boundary_surface(alone.mesh));

    EXPECT_FALSE(check_tets(alone.mesh, run).any());
    EXPECT_GT(surface.radius_ratio.mean, body.radius_ratio.mean - 0.005);
    EXPECT_GT(surface.min_angle.min, 30.0);
}

TEST(ImproveMesh, LeavesOutUnusedVertices) {
    const auto improved = improve_sphere();

    std::vector<bool> used(improved.mesh.vertices.size(), false);
    for (const auto& tet : improved.mesh.tets) {
        for (const Index v : tet) {
            used[at(v)] = true;
        }
    }
    EXPECT_THAT(used, ::testing::Each(true));
    EXPECT_EQ(improved.kind.size(), used.size());
    EXPECT_EQ(improved.curve.size(), used.size());
}

TEST(ImproveMesh, GivesTheSameBitsOnAnyNumberOfThreads) {
    const auto on_threads = [](int threads) {
        tbb::task_arena arena(threads);
        return arena.execute([] { return improve_sphere(); });
    };
    const auto expected = on_threads(1);

    for (const int threads : {2, 8}) {
        const auto actual = on_threads(threads);
        EXPECT_TRUE(actual.mesh.vertices == expected.mesh.vertices) << threads << " threads";
        EXPECT_TRUE(actual.mesh.tets == expected.mesh.tets) << threads << " threads";
    }
}

// Two spheres that touch; the left one is to swell into the right one as far as it may.
class SwellingDomain final : public testing::AnalyticDomain {
public:
    static constexpr double kApart = 2.02;

    SwellingDomain() : AnalyticDomain(testing::icosphere(3)) {}

    [[nodiscard]] BoundaryPoint closest(const Vec3& point, Index /*hint*/) const override {
        const bool is_left = point.x() < 0.5 * kApart;
        const Vec3 center = is_left ? Vec3(0, 0, 0) : Vec3(kApart, 0, 0);
        const double radius = is_left ? 1.04 : 1.0;
        BoundaryPoint on;
        on.normal = (point - center).normalized();
        on.point = center + radius * on.normal;
        on.distance = (on.point - point).norm();
        return on;
    }
    [[nodiscard]] double signed_distance(const Vec3& point) const override {
        return std::min(point.norm(), (point - Vec3(kApart, 0, 0)).norm()) - 1.0;
    }
};

TEST(ImproveMesh, FreezesVerticesWhereItsResultWouldIntersectItself) {
    auto carved = carved_sphere();
    const auto count = static_cast<Index>(carved.result.mesh.vertices.size());
    for (Index v = 0; v < count; ++v) {
        const Vec3 x = carved.result.mesh.vertices[at(v)];
        const Vec3 mirrored(SwellingDomain::kApart - x.x(), x.y(), x.z());
        carved.result.mesh.vertices.push_back(mirrored);
        carved.result.kind.push_back(carved.result.kind[at(v)]);
        carved.anchor.push_back(kNone);
    }
    const auto tets = carved.result.mesh.tets;
    for (const Tet& t : tets) {
        carved.result.mesh.tets.push_back({t[1] + count, t[0] + count, t[2] + count, t[3] + count});
    }
    RunContext run;

    const auto improved = improve_mesh(carved.result, carved.anchor, SwellingDomain(), {}, {}, run);

    EXPECT_GT(improved.rounds, 1);
    EXPECT_GT(improved.frozen_vertices, 0);
    EXPECT_LT(improved.frozen_vertices, count);
    EXPECT_FALSE(check_tets(improved.mesh, run).any());
    EXPECT_GT(volume(improved.mesh), 1.04 * volume(carved.result.mesh));
}

TEST(ImproveMesh, KeepsTheCornersOfABoxAndSlidesAlongItsEdges) {
    const testing::BoxDomain domain(Vec3::Ones());
    const auto carved = carved_box(domain);
    RunContext run;

    const auto improved =
        improve_mesh(carved.result, carved.anchor, domain, domain.features(), {}, run);

    std::size_t corners = 0;
    for (std::size_t v = 0; v < improved.kind.size(); ++v) {
        const Vec3 x = improved.mesh.vertices[v];
        const auto on_face = (x.array().abs() < 1e-9) || ((x.array() - 1.0).abs() < 1e-9);
        if (improved.kind[v] == ParticleKind::Corner) {
            ++corners;
            EXPECT_EQ(on_face.count(), 3);
        } else if (improved.kind[v] == ParticleKind::Curve) {
            EXPECT_EQ(on_face.count(), 2) << x.transpose();
            EXPECT_NE(improved.curve[v], kNone);
        }
    }
    EXPECT_EQ(corners, 8U);
    EXPECT_NEAR(volume(improved.mesh), 1.0, 1e-9);
    EXPECT_FALSE(check_tets(improved.mesh, run).any());
}

TEST(ImproveMesh, NeverLetsTheWorstElementOfABoxGetWorse) {
    const testing::BoxDomain domain(Vec3::Ones());
    const auto carved = carved_box(domain);
    RunContext run;

    const auto improved =
        improve_mesh(carved.result, carved.anchor, domain, domain.features(), {}, run);

    EXPECT_GE(worst_dihedral_sine(improved.mesh), worst_dihedral_sine(carved.result.mesh));
}

TEST(ImproveMesh, LeavesAStrictDelaunayMeshAsItIs) {
    const auto carved = carved_sphere();

    const auto improved = improve_sphere({.mode = ImproveMode::StrictDelaunay});

    EXPECT_TRUE(improved.mesh.tets.size() == carved.result.mesh.tets.size());
    EXPECT_DOUBLE_EQ(volume(improved.mesh), volume(carved.result.mesh));
    EXPECT_EQ(improved.flips, 0);
}

TEST(ImproveMesh, RaisesTheWorstAngleMoreInItsMaxMinAngleMode) {
    const auto balanced = improve_sphere();

    const auto steep = improve_sphere({.mode = ImproveMode::MaxMinAngle});

    EXPECT_GE(worst_dihedral_sine(steep.mesh), worst_dihedral_sine(balanced.mesh));
}

TEST(ImproveMesh, TellsTheQualityAfterEachPass) {
    const auto carved = carved_sphere();
    std::vector<QualitySample> samples;
    RunContext run({}, [&](const RunEvent& event) {
        if (const auto* sample = std::get_if<ConvergenceSample>(&event)) {
            samples.push_back(*sample->quality);
        }
    });
    run.enter(Stage::Improve);

    improve_mesh(carved.result, carved.anchor, testing::SphereDomain(1.0), {}, {.passes = 3}, run);

    ASSERT_EQ(samples.size(), 3U);
    EXPECT_GT(samples.back().mean, 0.8);
    EXPECT_LT(samples.back().first_percentile, samples.back().mean);
}

// A flat tet with both its upper triangles on the boundary, on two legs that have only its lower
// edge in common: without it the legs would hold together by that edge alone.
TEST(RemoveEdge, LeavesATetInPlaceThatHoldsTheBoundaryTogether) {
    improve::LiveMesh mesh;
    for (const Vec3& x : {Vec3(-1, 0, 0), Vec3(1, 0, 0), Vec3(0, -1, -0.1), Vec3(0, 1, -0.1),
                          Vec3(-0.3, 0, -1), Vec3(0.3, 0, -1), Vec3(-1, -1, -1), Vec3(1, -1, -1)}) {
        mesh.add_vertex(x, ParticleKind::Surface, kNone, false);
    }
    for (Tet tet :
         {Tet{0, 1, 2, 3}, Tet{0, 2, 3, 4}, Tet{1, 2, 3, 5}, Tet{0, 2, 4, 6}, Tet{1, 2, 5, 7}}) {
        const Vec3& a = mesh.point(tet[0]);
        if ((mesh.point(tet[1]) - a).dot((mesh.point(tet[2]) - a).cross(mesh.point(tet[3]) - a)) <
            0.0) {
            std::swap(tet[2], tet[3]);
        }
        mesh.append_tet(tet);
    }
    mesh.build_incidence();

    EXPECT_FALSE(improve::remove_edge(mesh, 0, 1, improve::Judge::RadiusRatio));

    EXPECT_TRUE(mesh.is_alive(0));
    EXPECT_EQ(mesh.slot_count(), 5U);
}

TEST(ImproveMesh, RefusesACarvedMeshThatIsNotValid) {
    auto carved = carved_sphere();
    std::swap(carved.result.mesh.tets[5][0], carved.result.mesh.tets[5][1]);
    RunContext run;

    try {
        improve_mesh(carved.result, carved.anchor, testing::SphereDomain(1.0), {},
                     {.mode = ImproveMode::StrictDelaunay}, run);
        FAIL() << "expected an error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Unmeshable);
        EXPECT_THAT(error.what(), HasSubstr("inverted"));
    }
}

TEST(ImproveMesh, StopsWhenAsked) {
    const auto carved = carved_sphere();
    std::stop_source stop;
    stop.request_stop();
    RunContext run(stop.get_token());

    try {
        improve_mesh(carved.result, carved.anchor, testing::SphereDomain(1.0), {}, {}, run);
        FAIL() << "expected an error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Cancelled);
    }
}

struct BadOption {
    const char* sentence;
    ImproveOptions options;
};

class ImproveOptionsTest : public ::testing::TestWithParam<BadOption> {};

TEST_P(ImproveOptionsTest, AreNamedWhenOutOfRange) {
    try {
        validate(GetParam().options);
        FAIL() << "expected an error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::InvalidInput);
        EXPECT_STREQ(error.what(), GetParam().sentence);
    }
}

INSTANTIATE_TEST_SUITE_P(
    All, ImproveOptionsTest,
    ::testing::Values(BadOption{"improve.passes must be at least 0, got -1", {.passes = -1}},
                      BadOption{"improve.power must be in [1, 12], got 13", {.power = 13.0}},
                      BadOption{"improve.surface_weight must be finite and at least 0, got -1",
                                {.surface_weight = -1.0}},
                      BadOption{"improve.flip_below must be in [0, 1], got 1.5",
                                {.flip_below = 1.5}}));

}  // namespace
}  // namespace remesh
