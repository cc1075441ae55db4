#pragma once

#include <string>
#include <vector>

#include "core/run_context.h"
#include "server/jobs/job.h"
#include "server/store/artifact_store.h"

namespace remesh {

/// The input files of a job, open for reading.
class JobInputs {
public:
    /// \throws StoreError{Lost} if a file that is on record is gone
    JobInputs(const ArtifactStore& artifacts, const std::string& tenant, const JobRequest& request);

    /// Digest of the first one that isn't there; empty if all are, and only then are there files.
    [[nodiscard]] const std::string& missing() const { return missing_; }
    [[nodiscard]] JobFiles files() const {
        return {views_.at(0).bytes(), views_.size() > 1 ? views_[1].bytes() : std::string_view()};
    }
    /// Reads them all. \throws StoreError{Lost} if one doesn't have its digest any more;
    /// Error{Cancelled} if `run` was asked to stop
    void verify(ArtifactStore& artifacts, const RunContext& run) const;

private:
    std::string tenant_;
    std::vector<ArtifactView> views_{};
    std::string missing_{};
};

}  // namespace remesh
