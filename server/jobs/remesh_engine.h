#pragma once

#include <cstdint>
#include <optional>

#include "server/jobs/engine.h"

namespace remesh {

/// The mesher: reads the file, runs the pipeline, writes the wanted files, the report and a
/// preview.
class RemeshEngine final : public Engine {
public:
    /// \param max_job_bytes  runs that are likely to need more memory fail before they start
    explicit RemeshEngine(std::optional<std::int64_t> max_job_bytes = {})
        : max_job_bytes_(max_job_bytes) {}

    [[nodiscard]] std::vector<FieldProblem> check(const JobRequest& request) const override;
    [[nodiscard]] JobEstimate estimate(const JobRequest& request,
                                       std::string_view input) const override;
    JobResult run(const JobRequest& request, std::string_view input, RunContext& run,
                  OutputSink& outputs) const override;
    void write_preview(const SurfaceMesh& surface, std::ostream& out) const override;

private:
    std::optional<std::int64_t> max_job_bytes_;
};

}  // namespace remesh
