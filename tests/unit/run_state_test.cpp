// A run that goes on where another one stopped.

#include "core/run_state.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cstring>
#include <memory>
#include <numeric>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/geometry/lipschitz_field.h"
#include "core/geometry/sample_source.h"
#include "core/stages/relax.h"
#include "core/stages/seed.h"
#include "tests/support/analytic_domain.h"

namespace remesh::testing {
namespace {

constexpr std::chrono::hours kNever{1};

/// A box with curves, surface and volume, all of which relax.
struct Scene {
    explicit Scene(double h) : sizing(std::make_unique<UniformSizing>(h)) {}
    explicit Scene(std::unique_ptr<SizingField> field) : sizing(std::move(field)) {}

    Particles relax(RunContext& run) const {
        const FeatureSet features = box.features();
        Particles particles = seed_surface(box, features, *sizing, SeedOptions{}, run);
        particles = relax_surface(particles, box, features, *sizing, options, run).particles;
        particles = seed_volume(particles, box, *sizing, {}, SeedOptions{}, run);
        return relax_volume(particles, box, *sizing, options, run).particles;
    }

    BoxDomain box{Vec3(1.0, 0.8, 0.6)};
    std::unique_ptr<SizingField> sizing;
    RelaxOptions options{};
};

Scene graded_scene() {
    const auto source = std::make_shared<SampleSource>(
        std::vector<SizingSample>{{.x = Vec3::Zero(), .h = 0.08}}, 0.2);
    return Scene(std::make_unique<LipschitzField>(
        std::vector<std::shared_ptr<const SizingSource>>{source}, 0.08, 0.2));
}

std::string joined(const std::vector<std::string_view>& pieces) {
    return std::accumulate(
        pieces.begin(), pieces.end(), std::string(),
        [](std::string text, std::string_view piece) { return text.append(piece); });
}

struct Outcome {
    std::optional<Particles> particles{};  ///< Nothing if it was stopped.
    std::vector<ConvergenceSample> samples{};
    std::string saved{};  ///< When it was stopped.
};

/// Relaxes, from what an earlier run saved, until the sample of number `stop_at`.
Outcome run_scene(const Scene& scene, const std::string& saved, int stop_at) {
    Outcome outcome;
    std::stop_source stop;
    RunContext run(stop.get_token(), [&](const RunEvent& event) {
        const auto* sample = std::get_if<ConvergenceSample>(&event);
        if (sample != nullptr && sample->iteration == stop_at) {
            stop.request_stop();
        }
    });
    RunState state([&](const auto& pieces) { outcome.saved = joined(pieces); }, kNever);
    state.resume(saved);
    run.keep_state(state);
    try {
        outcome.particles = scene.relax(run);
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::Cancelled);
        state.save();
    }
    outcome.samples = run.samples();
    return outcome;
}

template <typename T>
bool have_same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

void expect_same(const Outcome& a, const Outcome& b) {
    ASSERT_TRUE(a.particles && b.particles);
    EXPECT_TRUE(have_same_bytes(a.particles->position, b.particles->position));
    EXPECT_TRUE(have_same_bytes(a.particles->normal, b.particles->normal));
    EXPECT_EQ(a.particles->h, b.particles->h);
    EXPECT_EQ(a.particles->anchor, b.particles->anchor);
    ASSERT_EQ(a.samples.size(), b.samples.size());
    for (std::size_t i = 0; i < a.samples.size(); ++i) {
        EXPECT_EQ(a.samples[i].iteration, b.samples[i].iteration);
        EXPECT_EQ(a.samples[i].kinetic_energy, b.samples[i].kinetic_energy);
        EXPECT_EQ(a.samples[i].simulated_time, b.samples[i].simulated_time);
    }
}

void expect_to_go_on_from_everywhere(const Scene& scene) {
    const Outcome whole = run_scene(scene, {}, 0);
    const int iterations = static_cast<int>(whole.samples.size());
    ASSERT_GT(iterations, 20);
    for (int stop_at = 1; stop_at < iterations; stop_at += 11) {
        const Outcome stopped = run_scene(scene, {}, stop_at);
        ASSERT_FALSE(stopped.particles);
        ASSERT_EQ(stopped.samples.size(), static_cast<std::size_t>(stop_at));
        expect_same(run_scene(scene, stopped.saved, 0), whole);
    }
}

TEST(RunState, LetsARunGoOnFromWhereverItWasStopped) {
    expect_to_go_on_from_everywhere(Scene(0.13));
}

TEST(RunState, LetsARunGoOnWhereSizesVary) {
    expect_to_go_on_from_everywhere(graded_scene());
}

TEST(RunState, LetsARunOfEachIntegratorGoOn) {
    for (const Integrator integrator : {Integrator::GradientDescent, Integrator::Fire}) {
        Scene scene(0.2);
        scene.options.integrator = integrator;
        expect_to_go_on_from_everywhere(scene);
    }
}

TEST(RunState, LetsARunGoOnWithOtherThreadsAndManyTimes) {
    const Scene scene(0.13);
    const Outcome whole = run_scene(scene, {}, 0);
    const int iterations = static_cast<int>(whole.samples.size());
    Outcome last;
    for (int stop_at = 5; stop_at < iterations; stop_at += 9) {
        tbb::task_arena arena(1 + stop_at % 3);
        arena.execute([&] { last = run_scene(scene, last.saved, stop_at); });
        ASSERT_FALSE(last.particles);
    }
    expect_same(run_scene(scene, last.saved, 0), whole);
}

TEST(RunState, KeepsWhatItWasGivenWhenTheNextRunStopsEarly) {
    const Scene scene(0.13);
    const Outcome stopped = run_scene(scene, {}, 60);
    std::stop_source stop;
    stop.request_stop();
    RunContext run(stop.get_token());
    std::string saved;
    RunState state([&](const auto& pieces) { saved = joined(pieces); }, kNever);
    state.resume(stopped.saved);
    run.keep_state(state);

    EXPECT_THROW(scene.relax(run), Error);
    state.save();

    EXPECT_EQ(saved, stopped.saved);
}

TEST(RunState, SavesWhileItRuns) {
    const Scene scene(0.13);
    const Outcome whole = run_scene(scene, {}, 0);
    std::vector<std::string> saves;
    RunContext run;
    RunState state([&](const auto& pieces) { saves.push_back(joined(pieces)); },
                   std::chrono::milliseconds(0));
    run.keep_state(state);
    scene.relax(run);

    ASSERT_FALSE(saves.empty());
    expect_same(run_scene(scene, saves[saves.size() / 2], 0), whole);
    expect_same(run_scene(scene, saves.back(), 0), whole);
}

TEST(RunState, RefusesTheStateOfAnotherRun) {
    const Outcome stopped = run_scene(Scene(0.13), {}, 70);

    EXPECT_THROW(run_scene(Scene(0.2), stopped.saved, 0), StaleState);
}

TEST(RunState, RefusesBytesThatAreCutOff) {
    const Scene scene(0.2);
    const std::string saved = run_scene(scene, {}, 25).saved;
    for (const std::size_t size : {std::size_t{3}, saved.size() / 3, saved.size() - 1}) {
        EXPECT_THROW(run_scene(scene, saved.substr(0, size), 0), StaleState);
    }
}

}  // namespace
}  // namespace remesh::testing
