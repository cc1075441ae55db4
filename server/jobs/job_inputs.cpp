#include "server/jobs/job_inputs.h"

namespace remesh {

JobInputs::JobInputs(const ArtifactStore& artifacts, const std::string& tenant,
                     const JobRequest& request) {
    for (const std::string& digest : request.inputs()) {
        const auto known = artifacts.find(tenant, digest);
        if (!known) {
            missing_ = digest;
            return;
        }
        views_.push_back(artifacts.open(tenant, *known));
    }
}

}  // namespace remesh
