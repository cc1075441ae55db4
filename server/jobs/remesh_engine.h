#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "server/jobs/engine.h"

namespace remesh {

/// The mesher: reads the file, runs the pipeline, writes the wanted files, the report as JSON and
/// as a page, and previews.
class RemeshEngine final : public Engine {
public:
    using DescribeOptions = std::function<std::vector<OptionRow>(const RemeshOptions&)>;

    /// \param describe  tells the report's page what options are called; without it they're left
    /// out
    explicit RemeshEngine(DescribeOptions describe = {}) : describe_(std::move(describe)) {}

    [[nodiscard]] std::vector<FieldProblem> check(const JobRequest& request) const override;
    JobResult run(const JobRequest& request, std::string_view input, RunContext& run,
                  OutputSink& outputs) const override;
    void write_preview(const SurfaceMesh& surface, std::ostream& out) const override;

private:
    /// Writes what is for people: the report and the previews.
    void add_views(const JobRequest& request, const SurfaceMesh& input, const RemeshResult& mesh,
                   const RunContext& run, OutputSink& outputs, JobResult& result) const;

    DescribeOptions describe_;
};

}  // namespace remesh
