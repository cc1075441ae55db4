#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

class RunState;

/// The steps of a run, in order.
enum class Stage {
    Read,
    Prepare,
    Features,
    Sizing,
    Seed,
    Relax,
    Tetrahedralize,
    Carve,
    Improve,
    Verify,
    Report,
    Write,
};

inline constexpr std::size_t kStageCount = 12;

/// Lower-case English name of a stage, e.g. "tetrahedralize".
[[nodiscard]] std::string_view stage_name(Stage stage);

/// How far a run has come.
struct Progress {
    Stage stage = Stage::Read;
    double stage_fraction = 0.0;  ///< Of this stage, in [0, 1].
    double run_fraction = 0.0;    ///< Of the whole run, in [0, 1]; never goes back.
};

/// Quality of the mesh so far, as part of a convergence sample; of many tets, estimated.
struct QualitySample {
    double mean = 0.0;  ///< Mean radius ratio (tets, or triangles before there are tets).
    double first_percentile = 0.0;  ///< 1 % quantile of the radius ratio.
    std::array<std::int64_t, 20>
        histogram{};  ///< Counts of the radius ratio in 20 equal bins of [0, 1].
};

/// One look at the relaxation or the improvement. Lengths are relative to the local spacing h,
/// energies and forces are in units of stiffness 1, mass 1 and h = 1.
struct ConvergenceSample {
    Stage stage = Stage::Relax;
    int iteration = 0;              ///< Counted over the whole run, from 1.
    double simulated_time = 0.0;    ///< Sum of the time steps so far.
    double kinetic_energy = 0.0;    ///< Per particle.
    double potential_energy = 0.0;  ///< Per particle.
    double max_displacement = 0.0;  ///< Of the last step.
    double rms_displacement = 0.0;  ///< Of the last step.
    double residual_force = 0.0;    ///< rms over the moving particles.
    std::int64_t particles = 0;
    std::int64_t surface_particles = 0;
    std::int64_t inserted = 0;  ///< By population control, so far.
    std::int64_t removed = 0;   ///< By population control, so far.
    std::optional<QualitySample> quality{};
    std::optional<double>
        max_deviation{};  ///< Largest distance of the surface so far from the input, relative to h.
};

/// Something the user should know although the run goes on.
struct Warning {
    std::string code{};        ///< Stable UPPER_SNAKE_CASE, e.g. "COARSENED".
    std::string message{};     ///< A sentence with numbers; no mesh data beyond counts and lengths.
    std::optional<Vec3> at{};  ///< Where in the mesh, model units.
};

/// The surface as it stands, for a person who watches; while particles relax, the particles.
struct Preview {
    int iteration = 0;
    SurfaceMesh
        surface{};  ///< At most about 20,000 triangles, or as many vertices and no triangle.
};

using RunEvent = std::variant<Progress, ConvergenceSample, Warning, Preview>;

/// What goes through every stage of one run: the wish to stop, and the way to tell how it goes.
///
/// `report`, `sample`, `warn` and `preview` are called from the run's own thread only;
/// `checkpoint` and `stop_requested` from any.
class RunContext {
public:
    using Sink = std::function<void(const RunEvent&)>;

    explicit RunContext(std::stop_token stop = {}, Sink sink = {});

    void enter(Stage stage);                ///< A stage begins. Also a checkpoint.
    void report(double fraction);           ///< [0, 1] of this stage, clamped. Also a checkpoint.
    void sample(ConvergenceSample sample);  ///< Fills in `stage` and a running `iteration`.
    void warn(Warning warning);
    void preview(SurfaceMesh surface);
    /// True when a sink listens and it is time for another preview: every half second at first,
    /// ever more seldom in a long run, and seldom enough that making them takes at most a twentieth
    /// of it.
    [[nodiscard]] bool wants_preview();

    /// Keeps the state of relaxations in `state`, which outlives the run, and goes on from what it
    /// has of an earlier run. To be called before the run starts.
    void keep_state(RunState& state) { state_ = &state; }
    /// Null unless the state is to be kept.
    [[nodiscard]] RunState* state() const noexcept { return state_; }
    /// Takes up samples of an earlier run that went before; watchers have seen them.
    void resume(const std::vector<ConvergenceSample>& samples);

    /// \throws Error{Cancelled} if the caller asked to stop
    void checkpoint() const;
    [[nodiscard]] bool stop_requested() const noexcept { return stop_.stop_requested(); }
    [[nodiscard]] Stage stage() const noexcept { return stage_; }
    /// Every sample so far, in order: the curves of the report.
    [[nodiscard]] const std::vector<ConvergenceSample>& samples() const noexcept {
        return samples_;
    }

private:
    std::stop_token stop_;
    Sink sink_;
    RunState* state_ = nullptr;
    Stage stage_ = Stage::Read;
    double run_fraction_ = 0.0;
    int iteration_ = 0;
    std::vector<ConvergenceSample> samples_{};
    std::int64_t started_ms_ = 0;
    std::int64_t preview_started_ms_ = 0;
    std::int64_t next_preview_ms_ = 0;
};

}  // namespace remesh
