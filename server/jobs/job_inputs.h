#pragma once

#include <string>
#include <vector>

#include "server/jobs/job.h"
#include "server/store/artifact_store.h"

namespace remesh {

/// The input files of a job, open for reading.
class JobInputs {
public:
    /// \throws StoreError if a file that is on record is gone
    JobInputs(const ArtifactStore& artifacts, const std::string& tenant, const JobRequest& request);

    /// Digest of the first one that isn't there; empty if all are, and only then are there files.
    [[nodiscard]] const std::string& missing() const { return missing_; }
    [[nodiscard]] JobFiles files() const {
        return {views_.at(0).bytes(), views_.size() > 1 ? views_[1].bytes() : std::string_view()};
    }

private:
    std::vector<ArtifactView> views_{};
    std::string missing_{};
};

}  // namespace remesh
