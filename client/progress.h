#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "client/session.h"
#include "remesh/v1/job.pb.h"

namespace remesh::client {

/// What the events so far say about a job.
struct ProgressState {
    v1::Job::State state = v1::Job::STATE_UNSPECIFIED;
    int queue_position = 0;
    v1::Stage stage = v1::STAGE_UNSPECIFIED;
    double fraction = 0.0;  ///< Of the whole run, in [0, 1].
    std::int64_t particles = 0;
    int iteration = 0;
    double residual = 0.0;
    std::optional<double> quality{};  ///< Mean radius ratio, when last measured.

    void apply(const v1::JobEvent& event);
};

/// The state in one line of at most `width` columns; what doesn't fit is left out from the right.
[[nodiscard]] std::string progress_line(const ProgressState& state, double seconds, int width);

/// A live line on stderr, if that is a terminal; nothing otherwise.
class ProgressBar {
public:
    /// \param title  goes in front, may be empty
    ProgressBar(std::string title, const Settings& settings);
    ~ProgressBar() { clear(); }
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;

    void apply(const v1::JobEvent& event);
    /// Takes the line away, so that something else can be printed.
    void clear();

private:
    using Clock = std::chrono::steady_clock;
    void draw();

    std::string title_;
    bool is_shown_;
    bool is_colored_;
    bool is_drawn_ = false;
    ProgressState state_;
    Clock::time_point start_ = Clock::now();
    Clock::time_point last_draw_;
};

}  // namespace remesh::client
