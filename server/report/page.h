#pragma once

#include <iosfwd>
#include <span>
#include <string>
#include <vector>

#include "core/pipeline.h"
#include "core/run_context.h"
#include "server/jobs/job.h"

namespace remesh::report {

/// What the page tells of a run.
struct PageContent {
    const JobRequest& request;
    const SurfaceMesh& input;
    const RemeshResult& result;
    std::span<const ConvergenceSample> samples;
    std::span<const JobOutput> files;
    std::span<const OptionRow> options;  ///< With everything that was chosen filled in.
    std::string engine_version;
    Time made{};
};

/// Writes a page that needs nothing else: pictures before and after, histograms, convergence,
/// measures, repairs, options and provenance. No scripts, no addresses; what came from the user is
/// text. Well-formed as XML too.
void write_page(const PageContent& content, std::ostream& out);

}  // namespace remesh::report
