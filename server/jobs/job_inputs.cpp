#include "server/jobs/job_inputs.h"

namespace remesh {

JobInputs::JobInputs(const ArtifactStore& artifacts, const std::string& tenant,
                     const JobRequest& request)
    : tenant_(tenant) {
    for (const std::string& digest : request.inputs()) {
        const auto known = artifacts.find(tenant, digest);
        if (!known) {
            missing_ = digest;
            return;
        }
        views_.push_back(artifacts.open(tenant, *known));
    }
}

void JobInputs::verify(ArtifactStore& artifacts, const RunContext& run) const {
    for (const ArtifactView& view : views_) {
        artifacts.require_whole(tenant_, view, [&run] { run.checkpoint(); });
    }
}

}  // namespace remesh
