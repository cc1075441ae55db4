#pragma once

#include "server/jobs/engine.h"

namespace remesh {

/// The mesher: reads the file, runs the pipeline, writes the wanted files, the report and a
/// preview.
class RemeshEngine final : public Engine {
public:
    [[nodiscard]] std::vector<FieldProblem> check(const JobRequest& request) const override;
    JobResult run(const JobRequest& request, std::string_view input, RunContext& run,
                  OutputSink& outputs) const override;
    void write_preview(const SurfaceMesh& surface, std::ostream& out) const override;
};

}  // namespace remesh
