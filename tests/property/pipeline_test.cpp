// What must hold for every input: shapes made in code, the anatomies of tests/data, and every file
// of the folder that REMESH_TEST_DATA names.
#include "core/pipeline.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>

#include "core/error.h"
#include "core/io/mesh_io.h"
#include "core/mesh/quality.h"
#include "core/stages/verify.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

struct Case {
    std::string name;
    SurfaceMesh surface{};
    std::optional<double> edge_length{};
    double volume = 0.0;  // Of the undamaged body; 0 where it isn't known.
    double volume_tolerance = 0.02;
};

void PrintTo(const Case& input, std::ostream* out) {
    *out << input.name;
}

SurfaceMesh read_file(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    return read_surface(bytes, path.filename().string()).mesh;
}

SurfaceMesh staircase_ball() {
    return testing::voxel_surface([](const Vec3& x) { return x.norm() < 8.0; },
                                  {Vec3::Constant(-9.5), Vec3::Constant(9.5)}, 1.0);
}

SurfaceMesh bifurcation() {
    const auto capsule = [](const Vec3& x, const Vec3& a, const Vec3& b, double r) {
        const double t = std::clamp((x - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
        return (x - a - t * (b - a)).norm() - r;
    };
    const auto value = [=](const Vec3& x) {
        return std::min({capsule(x, {0, 0, -1}, {0, 0, 0}, 0.25),
                         capsule(x, {0, 0, 0}, {0.6, 0.1, 0.9}, 0.2),
                         capsule(x, {0, 0, 0}, {-0.6, 0, 0.9}, 0.2)});
    };
    return testing::level_set(value, {Vec3(-0.9, -0.4, -1.4), Vec3(0.9, 0.4, 1.2)}, 0.04);
}

std::vector<Case> cases() {
    using namespace testing;
    const SurfaceMesh sphere = icosphere(4);
    const double ball = enclosed_volume(sphere);
    const SurfaceMesh fork = bifurcation();
    const double fork_volume = enclosed_volume(fork);
    const SurfaceMesh stairs = staircase_ball();
    std::vector<Case> all{
        {"sphere", sphere, 0.15, ball},
        {"torus", torus(1.0, 0.4, 64, 32), 0.15, 2 * M_PI * M_PI * 0.16, 0.03},
        {"cube", unit_cube(), 0.1, 1.0},
        {"l_shape", l_shape(), 0.15, 3.0},
        {"bifurcation", fork, 0.06, fork_volume},
        {"inside_out", transformed(sphere, -Eigen::Matrix3d::Identity(), Vec3::Zero()), 0.15, ball},
        {"soup_with_flips", as_soup(with_triangles_flipped(fork, 0.1, 1)), 0.06, fork_volume},
        {"holes", with_triangles_removed(fork, 0.05, 2), 0.06, fork_volume},
        {"noise", with_noise(sphere, 0.02, 3), 0.15, ball, 0.03},
        {"staircase", stairs, 1.2, enclosed_volume(stairs), 0.03},
        {"two_balls", join(sphere, transformed(sphere, Eigen::Matrix3d::Identity(), Vec3(3, 0, 0))),
         0.15, 2 * ball},
        {"aorta", read_file(REMESH_TEST_DATA_DIR "/aorta.stl"), 3.0},
        {"left_lateral_ventricle", read_file(REMESH_TEST_DATA_DIR "/left_lateral_ventricle.stl"),
         1.2},
    };
    if (const char* folder = std::getenv("REMESH_TEST_DATA")) {
        for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
            const auto format = format_of_name(entry.path().filename().string());
            if (!entry.is_regular_file() || !format || !can_read(*format)) {
                continue;
            }
            std::string name = entry.path().filename().string();
            std::replace_if(
                name.begin(), name.end(), [](char c) { return !std::isalnum(c); }, '_');
            all.push_back({"file_" + name, read_file(entry.path())});
        }
    }
    return all;
}

RemeshResult remesh_on(int threads, const SurfaceMesh& surface, const RemeshOptions& options) {
    RemeshResult result;
    tbb::task_arena(threads).execute([&] {
        RunContext run;
        result = run_pipeline(surface, options, run);
    });
    return result;
}

bool same_bits(const Points& a, const Points& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)) == 0;
}

class EveryInput : public ::testing::TestWithParam<Case> {};

TEST_P(EveryInput, GivesAValidMeshOfTheSameBody) {
    const Case& input = GetParam();

    const auto result = remesh_on(2, input.surface, {.edge_length = input.edge_length});

    EXPECT_FALSE(check_tets(result.tets, RunContext()).any());
    EXPECT_FALSE(check_surface(result.surface, RunContext()).any());
    EXPECT_NEAR(result.report.after.volume, result.report.tets->volume,
                1e-9 * result.report.after.volume);
    if (input.volume > 0.0) {
        EXPECT_NEAR(result.report.after.volume, input.volume,
                    input.volume_tolerance * input.volume);
    }
    EXPECT_GT(result.report.after.radius_ratio.mean, 0.95);
    EXPECT_GT(result.report.tets->radius_ratio.mean, 0.90);
    EXPECT_GT(result.report.tets->min_dihedral, 5.0);
}

TEST_P(EveryInput, GivesTheSameBitsOnAnyNumberOfThreads) {
    const Case& input = GetParam();
    const RemeshOptions options{.edge_length = input.edge_length};
    const auto expected = remesh_on(1, input.surface, options);

    for (const int threads : {2, 8}) {
        const auto actual = remesh_on(threads, input.surface, options);
        EXPECT_TRUE(same_bits(actual.tets.vertices, expected.tets.vertices)) << threads;
        EXPECT_EQ(actual.tets.tets, expected.tets.tets) << threads;
    }
}

TEST_P(EveryInput, GivesAValidSurfaceAlone) {
    const Case& input = GetParam();

    const auto result =
        remesh_on(2, input.surface, {.edge_length = input.edge_length, .tetrahedra = false});

    EXPECT_TRUE(result.tets.tets.empty());
    EXPECT_FALSE(result.report.tets.has_value());
    EXPECT_FALSE(check_surface(result.surface, RunContext()).any());
    EXPECT_GT(result.report.after.radius_ratio.mean, 0.95);
}

INSTANTIATE_TEST_SUITE_P(Inputs, EveryInput, ::testing::ValuesIn(cases()),
                         [](const auto& test) { return test.param.name; });

TEST(Pipeline, KeepsTheEightCornersOfACube) {
    const auto result = remesh_on(2, testing::unit_cube(), {.edge_length = 0.1});

    for (const auto& corner : testing::unit_cube().vertices) {
        const auto nearest =
            std::min_element(result.surface.vertices.begin(), result.surface.vertices.end(),
                             [&](const Vec3& a, const Vec3& b) {
                                 return (a - corner).norm() < (b - corner).norm();
                             });
        EXPECT_LT((*nearest - corner).norm(), 1e-9);
    }
}

/// What must be alike, to a share of itself, of meshes of one body.
void expect_alike(const RemeshResult& actual, const RemeshResult& expected, double scale,
                  double tolerance) {
    const double volume = expected.report.after.volume;
    const auto tets = static_cast<double>(expected.tets.tets.size());
    EXPECT_NEAR(actual.report.after.volume / std::pow(scale, 3), volume, tolerance * volume);
    EXPECT_NEAR(static_cast<double>(actual.tets.tets.size()), tets, 5.0 * tolerance * tets);
    EXPECT_NEAR(actual.report.tets->radius_ratio.mean, expected.report.tets->radius_ratio.mean,
                tolerance);
    EXPECT_EQ(actual.report.after.euler_characteristic, expected.report.after.euler_characteristic);
    EXPECT_EQ(actual.report.after.components, expected.report.after.components);
    EXPECT_FALSE(check_tets(actual.tets, RunContext()).any());
}

void expect_same_when_moved(const SurfaceMesh& surface, double h, double tolerance) {
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
    const auto expected = remesh_on(2, surface, {.edge_length = h});

    for (const double scale : {1e-3, 1.0, 1e3}) {
        const Vec3 shift = Vec3::Constant(1e6 * scale);
        const auto actual = remesh_on(2, testing::transformed(surface, scale * turn, shift),
                                      {.edge_length = h * scale});
        expect_alike(actual, expected, scale, tolerance);
    }
}

void expect_same_when_shuffled(SurfaceMesh surface, double h, double tolerance) {
    const auto expected = remesh_on(2, surface, {.edge_length = h});

    std::shuffle(surface.triangles.begin(), surface.triangles.end(), std::mt19937(5));

    expect_alike(remesh_on(2, surface, {.edge_length = h}), expected, 1.0, tolerance);
}

SurfaceMesh damaged_bifurcation() {
    return testing::with_noise(testing::with_triangles_flipped(
                                   testing::with_triangles_removed(bifurcation(), 0.05, 2), 0.1, 3),
                               0.005, 4);
}

TEST(Pipeline, MovingTurningAndScalingTheInputDoesTheSameToTheOutput) {
    expect_same_when_moved(bifurcation(), 0.06, 0.01);
}

TEST(Pipeline, MovingTurningAndScalingADamagedInputDoesTheSameToTheOutput) {
    expect_same_when_moved(damaged_bifurcation(), 0.06, 0.015);
}

TEST(Pipeline, MovingTurningAndScalingStairsDoesTheSameToTheOutput) {
    expect_same_when_moved(staircase_ball(), 1.2, 0.01);
}

TEST(Pipeline, ShufflingTheTrianglesChangesNothingThatMatters) {
    expect_same_when_shuffled(bifurcation(), 0.06, 2e-3);
}

TEST(Pipeline, ShufflingTheTrianglesOfADamagedInputChangesNothingThatMatters) {
    expect_same_when_shuffled(damaged_bifurcation(), 0.06, 0.01);
}

class EveryPropagation : public ::testing::TestWithParam<Propagation> {};

TEST_P(EveryPropagation, GradesAnAortaAlikeOnAnyNumberOfThreads) {
    RemeshOptions options;
    options.edge_length = 2.0;
    options.sizing.max_size = 8.0;
    options.sizing.chord_error = 0.08;
    options.sizing.propagation = GetParam();
    const SurfaceMesh surface = read_file(REMESH_TEST_DATA_DIR "/aorta.stl");

    const RemeshResult one = remesh_on(1, surface, options);
    const RemeshResult more = remesh_on(3, surface, options);

    EXPECT_TRUE(same_bits(more.tets.vertices, one.tets.vertices));
    EXPECT_EQ(more.tets.tets, one.tets.tets);
    EXPECT_GE(one.report.tets->radius_ratio.mean, 0.90);
    EXPECT_GE(one.report.tets->min_dihedral, 20.0);
}

INSTANTIATE_TEST_SUITE_P(Modes, EveryPropagation,
                         ::testing::Values(Propagation::Lipschitz, Propagation::Multigrid,
                                           Propagation::Coupled));

TEST(Pipeline, ChoosesAnEdgeLengthWhenNoneIsGiven) {
    const auto result = remesh_on(2, testing::icosphere(4), {});

    EXPECT_GT(result.edge_length, 0.01);
    EXPECT_LT(result.edge_length, 0.5);
    EXPECT_FALSE(check_tets(result.tets, RunContext()).any());
}

TEST(Pipeline, RefusesWhatEnclosesNoBody) {
    SurfaceMesh triangle = testing::unit_cube();
    triangle.triangles.resize(1);
    SurfaceMesh sheet = testing::unit_cube();
    sheet.triangles.resize(2);

    RunContext run;
    EXPECT_THROW(run_pipeline(triangle, {.edge_length = 0.1}, run), Error);
    EXPECT_THROW(run_pipeline(sheet, {.edge_length = 0.1}, run), Error);
    EXPECT_THROW(run_pipeline(SurfaceMesh{}, {.edge_length = 0.1}, run), Error);
    EXPECT_THROW(run_pipeline(SurfaceMesh{}, {}, run), Error);
}

TEST(Pipeline, RefusesABodyThatWouldLoseMostOfItsVolume) {
    const SurfaceMesh plate = testing::transformed(
        testing::unit_cube(), Vec3(20.0, 20.0, 0.4).asDiagonal(), Vec3::Zero());
    RunContext run;
    try {
        run_pipeline(plate, {.edge_length = 2.0}, run);
        FAIL() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Unmeshable);
        EXPECT_NE(std::string(error.what()).find("too thin for edge_length 2"), std::string::npos)
            << error.what();
    }
}

TEST(Pipeline, TellsOfPartsThatTheEdgeLengthIsTooCoarseFor) {
    const SurfaceMesh balls = testing::join(
        testing::icosphere(3),
        testing::transformed(testing::icosphere(2), 0.2 * Eigen::Matrix3d::Identity(), {2, 0, 0}));
    RunContext run;

    const auto coarse = run_pipeline(balls, {.edge_length = 0.24}, run);
    const auto fine = run_pipeline(balls, {.edge_length = 0.12}, run);

    const auto lost = [](const RemeshResult& result) {
        const auto& defects = result.report.defects;
        return std::any_of(defects.begin(), defects.end(),
                           [](const Defect& defect) { return defect.code == "LOST_PARTS"; });
    };
    EXPECT_EQ(coarse.report.after.components, 1);
    EXPECT_TRUE(lost(coarse));
    EXPECT_EQ(fine.report.after.components, 2);
    EXPECT_FALSE(lost(fine));
}

TEST(Pipeline, MeshesABallThatIsTwoEdgesAcross) {
    RunContext run;

    const auto result = run_pipeline(testing::icosphere(3), {.edge_length = 1.0}, run);

    EXPECT_FALSE(check_tets(result.tets, run).any());
    EXPECT_LT(result.report.volume_change, 0.0);
    const auto& defects = result.report.defects;
    EXPECT_TRUE(std::any_of(defects.begin(), defects.end(),
                            [](const Defect& defect) { return defect.code == "VOLUME_CHANGED"; }));
}

TEST(Pipeline, RefusesAnEdgeLengthThatIsNotPositive) {
    RunContext run;
    for (const double bad : {0.0, -1.0, std::nan("")}) {
        try {
            run_pipeline(testing::unit_cube(), {.edge_length = bad}, run);
            FAIL() << "accepted " << bad;
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::InvalidInput);
            EXPECT_NE(std::string(error.what()).find("edge_length must be > 0"), std::string::npos);
        }
    }
}

TEST(Pipeline, StopsInEveryStage) {
    for (std::size_t stage = 1; stage + 1 < kStageCount; ++stage) {
        std::stop_source stop;
        RunContext run(stop.get_token(), [&](const RunEvent& event) {
            const auto* progress = std::get_if<Progress>(&event);
            if (progress != nullptr && progress->stage == static_cast<Stage>(stage)) {
                stop.request_stop();
            }
        });
        try {
            run_pipeline(testing::icosphere(3), {.edge_length = 0.2}, run);
            FAIL() << "went on after a stop in " << stage_name(static_cast<Stage>(stage));
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::Cancelled);
        }
    }
}

TEST(Pipeline, TellsEveryRelaxationStep) {
    int samples = 0;
    double last_fraction = 0.0;
    RunContext run({}, [&](const RunEvent& event) {
        if (const auto* sample = std::get_if<ConvergenceSample>(&event)) {
            EXPECT_EQ(sample->iteration, ++samples);
            EXPECT_TRUE(std::isfinite(sample->potential_energy));
            EXPECT_GT(sample->particles, 0);
        }
        if (const auto* progress = std::get_if<Progress>(&event)) {
            EXPECT_GE(progress->run_fraction, last_fraction);
            last_fraction = progress->run_fraction;
        }
    });

    run_pipeline(testing::icosphere(3), {.edge_length = 0.2}, run);

    EXPECT_GT(samples, 10);
}

}  // namespace
}  // namespace remesh
