#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "server/jobs/engine.h"

namespace remesh {

/// The mesher: reads the file, runs the pipeline, writes the wanted files, the report as JSON and
/// as a page, and previews.
class RemeshEngine final : public Engine {
public:
    using DescribeOptions = std::function<std::vector<OptionRow>(const RemeshOptions&)>;

    /// \param max_job_bytes  runs that are likely to need more memory fail before they start
    /// \param describe  tells the report's page what options are called; without it they're left
    /// out
    explicit RemeshEngine(std::optional<std::int64_t> max_job_bytes = {},
                          DescribeOptions describe = {})
        : max_job_bytes_(max_job_bytes), describe_(std::move(describe)) {}

    [[nodiscard]] std::vector<FieldProblem> check(const JobRequest& request) const override;
    [[nodiscard]] JobEstimate estimate(const JobRequest& request,
                                       const JobFiles& inputs) const override;
    JobResult run(const JobRequest& request, const JobFiles& inputs, RunContext& run,
                  OutputSink& outputs) const override;
    void write_preview(const SurfaceMesh& surface, std::ostream& out) const override;

private:
    /// Writes what is for people: the report and the previews.
    void add_views(const JobRequest& request, const SurfaceMesh& input, const RemeshResult& mesh,
                   const RunContext& run, OutputSink& outputs, JobResult& result) const;

    std::optional<std::int64_t> max_job_bytes_;
    DescribeOptions describe_;
};

}  // namespace remesh
