// A whole run that is stopped while particles relax, and another one that goes on from there.

#include <gtest/gtest.h>

#include <stop_token>
#include <string>

#include "core/error.h"
#include "core/pipeline.h"
#include "core/run_state.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

constexpr std::chrono::hours kNever{1};

std::string joined(const std::vector<std::string_view>& pieces) {
    std::string text;
    for (const std::string_view piece : pieces) {
        text.append(piece);
    }
    return text;
}

/// A run that is stopped at the sample of number `stop_at`. \return what was saved
std::string saved_at(int stop_at, const SurfaceMesh& input, const RemeshOptions& options) {
    std::stop_source stop;
    RunContext run(stop.get_token(), [&](const RunEvent& event) {
        const auto* sample = std::get_if<ConvergenceSample>(&event);
        if (sample != nullptr && sample->iteration == stop_at) {
            stop.request_stop();
        }
    });
    std::string saved;
    RunState state([&](const auto& pieces) { saved = joined(pieces); }, kNever);
    run.keep_state(state);
    EXPECT_THROW(run_pipeline(input, options, run), Error);
    state.save();
    return saved;
}

RemeshResult resumed(const std::string& saved, const SurfaceMesh& input,
                     const RemeshOptions& options, std::size_t& samples) {
    RunContext run;
    RunState state([](const auto&) {}, kNever);
    state.resume(saved);
    run.keep_state(state);
    RemeshResult result = run_pipeline(input, options, run);
    samples = run.samples().size();
    return result;
}

void expect_same(const TetMesh& a, const TetMesh& b) {
    ASSERT_EQ(a.tets, b.tets);
    ASSERT_EQ(a.vertices.size(), b.vertices.size());
    for (std::size_t i = 0; i < a.vertices.size(); ++i) {
        ASSERT_EQ(a.vertices[i], b.vertices[i]) << i;
    }
}

/// \param shares  of the samples of a run, in (0, 1): where it is stopped
RemeshResult expect_same_from(std::initializer_list<double> shares, const SurfaceMesh& input,
                              const RemeshOptions& options) {
    RunContext run;
    RemeshResult whole = run_pipeline(input, options, run);
    for (const double share : shares) {
        const auto stop_at = static_cast<int>(share * static_cast<double>(run.samples().size()));
        const std::string saved = saved_at(stop_at, input, options);
        std::size_t samples = 0;
        expect_same(resumed(saved, input, options, samples).tets, whole.tets);
        EXPECT_EQ(samples, run.samples().size());
    }
    return whole;
}

TEST(Resume, EndsAsAnUndisturbedRunWhereEdgesAreSharp) {
    RemeshOptions options;
    options.edge_length = 0.15;
    expect_same_from({0.03, 0.2, 0.6, 0.9}, testing::l_shape(), options);
}

TEST(Resume, EndsAsAnUndisturbedRunThatHadToCoarsen) {
    RemeshOptions options;
    options.edge_length = 0.2;
    options.max_tets = 3'000;
    const auto whole = expect_same_from({0.1, 0.5, 0.9}, testing::icosphere(3), options);
    EXPECT_EQ(whole.report.coarsened_from, 0.2);
}

TEST(Resume, EndsAsAnUndisturbedRunWhoseSizesDiffuseOnTheParticles) {
    RemeshOptions options;
    options.edge_length = 0.2;
    options.sizing.max_size = 0.6;
    options.sizing.chord_error = 0.01;
    options.sizing.propagation = Propagation::Coupled;
    expect_same_from({0.1, 0.5, 0.8}, testing::icosphere(3), options);
}

}  // namespace
}  // namespace remesh
