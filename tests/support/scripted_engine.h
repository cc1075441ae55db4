#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <ostream>
#include <string>
#include <string_view>

#include "server/jobs/engine.h"

namespace remesh::testing {

/// Holds a run until the test lets it go or it is stopped.
class Gate {
public:
    void open() {
        const std::scoped_lock lock(mutex_);
        is_open_ = true;
        changed_.notify_all();
    }

    /// Returns once a run stands before it.
    void wait_for_a_run() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return is_reached_; });
    }

    /// \throws Error{Cancelled} if the run is stopped meanwhile
    void pass(const RunContext& run) {
        std::unique_lock lock(mutex_);
        is_reached_ = true;
        changed_.notify_all();
        while (
            !changed_.wait_for(lock, std::chrono::milliseconds(2), [this] { return is_open_; })) {
            run.checkpoint();
        }
    }

private:
    std::mutex mutex_;
    std::condition_variable changed_;
    bool is_open_ = false;
    bool is_reached_ = false;
};

/// Writes one output with what came in. A test may give it other things to do.
class ScriptedEngine final : public Engine {
public:
    using Script =
        std::function<JobResult(const JobRequest&, const JobFiles&, RunContext&, OutputSink&)>;

    explicit ScriptedEngine(Script script = copy_input) : script_(std::move(script)) {}

    static JobResult copy_input(const JobRequest&, const JobFiles& inputs, RunContext& run,
                                OutputSink& outputs) {
        run.enter(Stage::Relax);
        const auto artifact = outputs.add(
            [&](std::ostream& out) { out << "out:" << inputs.surface << inputs.size_image; });
        JobResult result;
        result.outputs.push_back({OutputKind::Surface, MeshFormat::Stl, artifact, "out.stl"});
        return result;
    }

    [[nodiscard]] std::vector<FieldProblem> check(const JobRequest& request) const override {
        std::vector<FieldProblem> problems;
        if (request.options.edge_length.value_or(1.0) <= 0.0) {
            problems.push_back({"edge_length", "edge_length must be > 0"});
        }
        if (request.options.relax.damping > 2.0) {
            problems.push_back({"relax.damping", "relax.damping must be in (0, 2]"});
        }
        return problems;
    }
    [[nodiscard]] JobEstimate estimate(const JobRequest&, const JobFiles& inputs) const override {
        return {.triangles = 100,
                .tets = static_cast<std::int64_t>(inputs.surface.size() + inputs.size_image.size()),
                .cpu_seconds = 1.5,
                .memory_bytes = 1 << 20};
    }
    JobResult run(const JobRequest& request, const JobFiles& inputs, RunContext& run,
                  OutputSink& outputs) const override {
        return script_(request, inputs, run, outputs);
    }
    void write_preview(const SurfaceMesh& surface, std::ostream& out) const override {
        out << "preview of " << surface.triangles.size() << " triangles "
            << surface.vertices.size();
    }

private:
    Script script_;
};

/// Copies the input once a gate lets it.
inline ScriptedEngine::Script behind(Gate& gate) {
    return [&gate](const JobRequest& request, const JobFiles& inputs, RunContext& run,
                   OutputSink& outputs) {
        gate.pass(run);
        return ScriptedEngine::copy_input(request, inputs, run, outputs);
    };
}

}  // namespace remesh::testing
