#include <algorithm>

#include "tests/support/model_job_store.h"

namespace remesh::testing {

bool ModelJobStore::add_artifact(const std::string& tenant, const ArtifactId& artifact,
                                 std::optional<std::int64_t> max_bytes, Time now) {
    const std::scoped_lock lock(mutex_);
    if (artifacts_.contains({tenant, artifact.sha256})) {
        return true;
    }
    const auto limit = policies_[tenant].max_bytes ? policies_[tenant].max_bytes : max_bytes;
    if (limit && bytes_of(tenant) + artifact.size > *limit) {
        return false;
    }
    artifacts_[{tenant, artifact.sha256}] = {artifact.size, now};
    return true;
}

std::optional<ArtifactId> ModelJobStore::find_artifact(const std::string& tenant,
                                                       const std::string& sha256) {
    const std::scoped_lock lock(mutex_);
    const auto found = artifacts_.find({tenant, sha256});
    return found == artifacts_.end() ? std::nullopt
                                     : std::optional(ArtifactId{sha256, found->second.first});
}

std::vector<std::string> ModelJobStore::drop_previews(const JobKey& key,
                                                      std::span<const std::string> keep) {
    const std::scoped_lock lock(mutex_);
    std::vector<std::string> dropped;
    if (Entry* entry = entry_of(key)) {
        std::erase_if(entry->references, [&](const auto& reference) {
            const bool is_dropped =
                reference.first == "preview" &&
                std::find(keep.begin(), keep.end(), reference.second) == keep.end();
            if (is_dropped) {
                dropped.push_back(reference.second);
            }
            return is_dropped;
        });
    }
    return dropped;
}

bool ModelJobStore::remove_artifact(const std::string& tenant, const std::string& sha256) {
    const std::scoped_lock lock(mutex_);
    return !is_needed({tenant, sha256}) && artifacts_.erase({tenant, sha256}) > 0;
}

std::vector<JobKey> ModelJobStore::unreferenced_artifacts(Time before) {
    const std::scoped_lock lock(mutex_);
    std::vector<JobKey> found;
    for (const auto& [key, what] : artifacts_) {
        if (what.second < before && !is_needed(key)) {
            found.push_back(key);
        }
    }
    return found;
}

std::int64_t ModelJobStore::stored_bytes(const std::string& tenant) {
    const std::scoped_lock lock(mutex_);
    return bytes_of(tenant);
}

void ModelJobStore::set_policy(const std::string& tenant, const TenantPolicy& policy) {
    const std::scoped_lock lock(mutex_);
    policies_[tenant] = policy;
}

TenantPolicy ModelJobStore::policy(const std::string& tenant) {
    const std::scoped_lock lock(mutex_);
    return policies_[tenant];
}

std::int64_t ModelJobStore::bytes_of(const std::string& tenant) const {
    std::int64_t sum = 0;
    for (const auto& [key, what] : artifacts_) {
        sum += key.tenant == tenant ? what.first : 0;
    }
    return sum;
}

bool ModelJobStore::is_needed(const JobKey& artifact) const {
    return std::any_of(jobs_.begin(), jobs_.end(), [&](const Entry& entry) {
        return entry.job.key.tenant == artifact.tenant &&
               std::any_of(entry.references.begin(), entry.references.end(),
                           [&](const auto& pair) { return pair.second == artifact.id; });
    });
}

}  // namespace remesh::testing
