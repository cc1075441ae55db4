#include "client/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <unistd.h>
#include <utility>
#include <vector>

#include "client/text.h"

namespace remesh::client {
namespace {

constexpr int kBarColumns = 20;
constexpr auto kRedrawInterval = std::chrono::milliseconds(80);

int terminal_width() {
    winsize size{};
    return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

bool is_smart_terminal() {
    const char* kind = std::getenv("TERM");
    return isatty(STDERR_FILENO) == 1 && kind != nullptr && std::string_view(kind) != "dumb";
}

/// The convention of https://no-color.org: set and not empty.
bool wants_no_color() {
    const char* value = std::getenv("NO_COLOR");
    return value != nullptr && *value != '\0';
}

std::string bar(double fraction) {
    const int full = static_cast<int>(std::floor(fraction * kBarColumns));
    return fmt::format("[{:=<{}}{:{}}]", "", full, "", kBarColumns - full);
}

std::string clock_word(double seconds) {
    const auto whole = static_cast<std::int64_t>(seconds);
    return whole < 3600
               ? fmt::format("{}:{:02}", whole / 60, whole % 60)
               : fmt::format("{}:{:02}:{:02}", whole / 3600, whole % 3600 / 60, whole % 60);
}

}  // namespace

void ProgressState::apply(const v1::JobEvent& event) {
    const auto take_progress = [this](const v1::Progress& progress) {
        stage = progress.stage();
        fraction = std::clamp(progress.fraction(), 0.0, 1.0);
    };
    if (event.has_snapshot() || event.has_completed()) {
        const v1::Job& job = event.has_snapshot() ? event.snapshot() : event.completed();
        state = job.state();
        queue_position = job.queue_position();
        take_progress(job.progress());
    } else if (event.has_progress()) {
        take_progress(event.progress());
    } else if (event.has_sample()) {
        const v1::ConvergenceSample& sample = event.sample();
        particles = sample.particles();
        iteration = sample.iteration();
        residual = sample.residual_force();
        if (sample.has_quality()) {
            quality = sample.quality().mean();
        }
    }
}

std::string progress_line(const ProgressState& state, double seconds, int width) {
    std::vector<std::string> parts;
    if (state.state == v1::Job::STATE_QUEUED || state.state == v1::Job::STATE_UNSPECIFIED) {
        parts.push_back(state.queue_position > 0
                            ? fmt::format("queued, {} ahead", state.queue_position)
                            : "queued");
    } else {
        parts.push_back(
            fmt::format("{} {:3.0f} %", bar(state.fraction), std::floor(100.0 * state.fraction)));
        parts.push_back(fmt::format("{:<14}", state.state == v1::Job::STATE_CANCELLING
                                                  ? "cancelling"
                                                  : stage_word(state.stage)));
    }
    parts.push_back(clock_word(seconds));
    if (state.iteration > 0) {
        parts.push_back(fmt::format("iteration {}", state.iteration));
    }
    if (state.residual > 0.0) {
        parts.push_back(fmt::format("residual {:.1e}", state.residual));
    }
    if (state.quality) {
        parts.push_back(fmt::format("quality {:.3f}", *state.quality));
    }
    if (state.particles > 0) {
        parts.push_back(fmt::format("{} particles", with_thousands(state.particles)));
    }
    std::string line;
    for (const std::string& part : parts) {
        const std::string longer = line.empty() ? part : line + "  " + part;
        if (columns(longer) > static_cast<std::size_t>(std::max(width, 0))) {
            break;
        }
        line = longer;
    }
    return line;
}

ProgressBar::ProgressBar(std::string title, const Settings& settings)
    : title_(std::move(title)),
      is_shown_(!settings.quiet && is_smart_terminal()),
      is_colored_(settings.color && !wants_no_color()) {}

void ProgressBar::apply(const v1::JobEvent& event) {
    state_.apply(event);
    const bool is_due = Clock::now() - last_draw_ >= kRedrawInterval;
    if (is_shown_ && (is_due || event.has_snapshot())) {
        draw();
    }
}

void ProgressBar::draw() {
    last_draw_ = Clock::now();
    is_drawn_ = true;
    const double seconds = std::chrono::duration<double>(last_draw_ - start_).count();
    const std::string title = title_.empty() ? "" : title_ + "  ";
    const int width = terminal_width() - 1 - static_cast<int>(columns(title));
    fmt::print(stderr, "\r{}{}{}{}\x1b[K", is_colored_ ? "\x1b[36m" : "", title,
               progress_line(state_, seconds, width), is_colored_ ? "\x1b[0m" : "");
    std::fflush(stderr);
}

void ProgressBar::clear() {
    if (std::exchange(is_drawn_, false)) {
        fmt::print(stderr, "\r\x1b[K");
        std::fflush(stderr);
    }
}

}  // namespace remesh::client
