#pragma once

#include <functional>
#include <iosfwd>
#include <vector>

#include "server/jobs/job.h"

namespace remesh {

/// Takes the files of one attempt. They become visible together, if the job succeeds.
class OutputSink {
public:
    using Writer = std::function<void(std::ostream&)>;

    OutputSink() = default;
    OutputSink(const OutputSink&) = delete;
    OutputSink& operator=(const OutputSink&) = delete;
    virtual ~OutputSink() = default;

    /// Takes what `write` writes. \return what was written
    virtual ArtifactId add(const Writer& write) = 0;
};

/// What a job means: checks and runs requests. Jobs are tested with an engine of their own.
class Engine {
public:
    Engine() = default;
    Engine(const Engine&) = delete;
    Engine& operator=(const Engine&) = delete;
    virtual ~Engine() = default;

    /// What is wrong with a request; empty if it can be run.
    [[nodiscard]] virtual std::vector<FieldProblem> check(const JobRequest& request) const = 0;
    /// What a run would need. \throws Error if an input can't be read
    [[nodiscard]] virtual JobEstimate estimate(const JobRequest& request,
                                               const JobFiles& inputs) const = 0;
    /// Runs a request in the present TBB arena.
    /// \throws Error, or whatever a defect throws
    virtual JobResult run(const JobRequest& request, const JobFiles& inputs, RunContext& run,
                          OutputSink& outputs) const = 0;
    /// Writes a preview as binary PLY.
    virtual void write_preview(const SurfaceMesh& surface, std::ostream& out) const = 0;
};

}  // namespace remesh
