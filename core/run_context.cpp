#include "core/run_context.h"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <utility>

#include "core/error.h"

namespace remesh {
namespace {

struct StageInfo {
    std::string_view name;
    int percent;  // Share of a run's CPU time; measured on 100k to 1M tets, uniform spacing.
};

constexpr std::array<StageInfo, kStageCount> kStages{{
    {"read", 1},
    {"prepare", 10},
    {"features", 1},
    {"sizing", 2},
    {"seed", 9},
    {"relax", 20},
    {"tetrahedralize", 10},
    {"carve", 7},
    {"improve", 30},
    {"verify", 3},
    {"report", 4},
    {"write", 3},
}};

constexpr int total_percent() {
    int sum = 0;
    for (const auto& stage : kStages) {
        sum += stage.percent;
    }
    return sum;
}
static_assert(total_percent() == 100);

constexpr std::size_t index_of(Stage stage) {
    return static_cast<std::size_t>(stage);
}

double start_of(Stage stage) {
    double sum = 0.0;
    for (std::size_t i = 0; i < index_of(stage); ++i) {
        sum += kStages[i].percent;
    }
    return sum / 100.0;
}

std::int64_t now_ms() {
    using namespace std::chrono;
    return duration_cast<milliseconds>(steady_clock::now().time_since_epoch()).count();
}

constexpr std::int64_t kPreviewEveryMs = 500;
// Part of the time that a run has taken: after a day, a preview every half hour.
constexpr std::int64_t kRunShare = 48;

}  // namespace

std::string_view stage_name(Stage stage) {
    return kStages[index_of(stage)].name;
}

RunContext::RunContext(std::stop_token stop, Sink sink)
    : stop_(std::move(stop)),
      sink_(std::move(sink)),
      started_ms_(now_ms()),
      next_preview_ms_(started_ms_ + kPreviewEveryMs) {}

void RunContext::enter(Stage stage) {
    stage_ = stage;
    report(0.0);
}

void RunContext::report(double fraction) {
    checkpoint();
    const double inside = std::clamp(fraction, 0.0, 1.0);
    const double run = start_of(stage_) + inside * kStages[index_of(stage_)].percent / 100.0;
    run_fraction_ = std::max(run_fraction_, run);
    if (sink_) {
        sink_(Progress{.stage = stage_, .stage_fraction = inside, .run_fraction = run_fraction_});
    }
}

void RunContext::sample(ConvergenceSample sample) {
    sample.stage = stage_;
    sample.iteration = ++iteration_;
    samples_.push_back(sample);
    if (sink_) {
        sink_(sample);
    }
}

void RunContext::resume(const std::vector<ConvergenceSample>& samples) {
    samples_.insert(samples_.end(), samples.begin(), samples.end());
    iteration_ += static_cast<int>(samples.size());
}

void RunContext::warn(Warning warning) {
    if (sink_) {
        sink_(std::move(warning));
    }
}

bool RunContext::wants_preview() {
    preview_started_ms_ = now_ms();
    return sink_ && preview_started_ms_ >= next_preview_ms_;
}

void RunContext::preview(SurfaceMesh surface) {
    const std::int64_t now = now_ms();
    next_preview_ms_ = now + std::max({kPreviewEveryMs, 20 * (now - preview_started_ms_),
                                       (now - started_ms_) / kRunShare});
    if (sink_) {
        sink_(Preview{.iteration = iteration_, .surface = std::move(surface)});
    }
}

void RunContext::checkpoint() const {
    if (stop_.stop_requested()) {
        throw Error(ErrorCode::Cancelled, "the run was cancelled");
    }
}

}  // namespace remesh
