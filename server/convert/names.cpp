#include <charconv>

#include "server/convert.h"
#include "server/store/digest.h"

namespace remesh {

JobKey job_key_of(const std::string& tenant, const std::string& name) {
    if (is_name(name)) {
        return {tenant, name};
    }
    const std::string_view text = name;
    const auto jobs = text.find("/jobs/");
    if (text.starts_with("tenants/") && jobs != std::string_view::npos) {
        const auto owner = text.substr(8, jobs - 8);
        const auto id = text.substr(jobs + 6);
        if (is_name(owner) && is_name(id)) {
            if (owner != tenant) {
                throw JobError(JobErrorCode::NotFound, "there is no such job", std::string(id));
            }
            return {tenant, std::string(id)};
        }
    }
    refuse("name", "must be \"tenants/{tenant}/jobs/{job}\" or \"{job}\"");
}

void require_own(const std::string& tenant, const std::string& parent) {
    if (parent.empty()) {
        return;
    }
    if (!parent.starts_with("tenants/") || !is_name(std::string_view(parent).substr(8))) {
        refuse("parent", "must be \"tenants/{tenant}\" or empty");
    }
    if (parent.substr(8) != tenant) {
        throw AccessError(AccessErrorCode::Denied, "parent must be the caller's own tenant");
    }
}

std::string job_name(const JobKey& key) {
    return "tenants/" + key.tenant + "/jobs/" + key.id;
}

std::int64_t revision_of(const std::string& etag) {
    std::int64_t revision = 0;
    const auto [end, error] = std::from_chars(etag.data(), etag.data() + etag.size(), revision);
    if (error != std::errc{} || end != etag.data() + etag.size()) {
        refuse("etag", "must be one that the server gave");
    }
    return revision;
}

void require_sha256(const std::string& sha256, const std::string& field) {
    if (!is_sha256(sha256)) {
        refuse(field, "must be 64 lower-case hexadecimal digits");
    }
}

ArtifactId artifact_of(const v1::Digest& digest, const std::string& field) {
    require_sha256(digest.sha256(), field + ".sha256");
    if (digest.size_bytes() < 0) {
        refuse(field + ".size_bytes", "must be >= 0, got " + std::to_string(digest.size_bytes()));
    }
    return {digest.sha256(), digest.size_bytes()};
}

void refuse(const std::string& field, const std::string& rule) {
    throw JobError({FieldProblem{field, field + " " + rule}});
}

}  // namespace remesh
