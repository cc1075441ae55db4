#pragma once

#include <grpcpp/support/status.h>

#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "remesh/v1/capability.pb.h"
#include "remesh/v1/job.pb.h"
#include "server/auth/principal.h"
#include "server/jobs/codec.h"
#include "server/jobs/registry.h"

// The one place that knows both proto and core. Its sources are in convert/, by topic.

namespace remesh {

// Names. All throw JobError{BadRequest} if they are malformed.

/// The job that a caller of `tenant` means by "tenants/{tenant}/jobs/{job}" or "{job}".
/// \throws JobError{NotFound} for another tenant's, as for one that never was
[[nodiscard]] JobKey job_key_of(const std::string& tenant, const std::string& name);
/// \throws AccessError{Denied} unless `parent` is empty or "tenants/{tenant}"
void require_own(const std::string& tenant, const std::string& parent);
[[nodiscard]] std::string job_name(const JobKey& key);
[[nodiscard]] std::int64_t revision_of(const std::string& etag);

// Requests.

/// \throws JobError{BadRequest} naming `field` unless it is 64 lower-case hexadecimal digits
void require_sha256(const std::string& sha256, const std::string& field);
/// What a digest names. \throws JobError{BadRequest} naming the part of `field` that is malformed
[[nodiscard]] ArtifactId artifact_of(const v1::Digest& digest, const std::string& field);

/// Checks the shape of a spec and gives the bytes that are stored: equal for equal specs.
/// \throws JobError{BadRequest}
[[nodiscard]] std::string canonical_spec(const v1::JobSpec& spec);
[[nodiscard]] JobRequest to_core(const v1::JobSpec& spec);
[[nodiscard]] RemeshOptions to_core(const v1::Options& options);
/// \throws JobError{BadRequest} for the unspecified or an unknown state
[[nodiscard]] JobState to_core(v1::Job::State state);

// Answers.

[[nodiscard]] v1::Job to_proto(const JobView& view);
/// \param job  the job as it is now; a State event shows it as it was then
[[nodiscard]] v1::JobEvent to_proto(const StoredEvent& event, const JobView& job);
[[nodiscard]] v1::Options to_proto(const RemeshOptions& options);
/// Every option by its path in v1.Options, in its order.
[[nodiscard]] std::vector<OptionRow> option_rows(const RemeshOptions& options);
[[nodiscard]] v1::Quality to_proto(const QualityReport& report);
[[nodiscard]] v1::Format to_proto(MeshFormat format);
/// Nothing for the unspecified or an unknown one.
[[nodiscard]] std::optional<MeshFormat> to_core(v1::Format format);
[[nodiscard]] v1::Stage to_proto(Stage stage);
[[nodiscard]] google::protobuf::Timestamp to_proto(Time time);

/// The path in a CreateJobRequest of what the engine calls `field`.
[[nodiscard]] std::string proto_field(const std::string& field);

// Errors.

/// \throws JobError{BadRequest} saying "`field` `rule`", as in "page_size must be in [0, 1000]"
[[noreturn]] void refuse(const std::string& field, const std::string& rule);

/// A status that no error of the rooms below stands for.
class StatusError : public std::exception {
public:
    explicit StatusError(grpc::Status status) : status_(std::move(status)) {}
    [[nodiscard]] const grpc::Status& status() const { return status_; }
    [[nodiscard]] const char* what() const noexcept override { return "the call failed"; }

private:
    grpc::Status status_;
};

/// What an exception of a handler means to the caller, with google.rpc details.
[[nodiscard]] grpc::Status to_status(const std::exception_ptr& error);
[[nodiscard]] grpc::Status shutting_down_status();
[[nodiscard]] grpc::Status artifact_not_found_status(const std::string& sha256);
[[nodiscard]] grpc::Status too_many_status(const std::string& subject,
                                           const std::string& description);
/// Of what becomes free again by itself.
[[nodiscard]] grpc::Status too_many_now_status(const std::string& subject,
                                               const std::string& description);

/// Specs, outcomes and events as serialized proto messages.
class ProtoCodec final : public JobCodec {
public:
    [[nodiscard]] JobRequest decode_spec(std::string_view spec) const override;
    [[nodiscard]] std::string cache_key(std::string_view spec) const override;
    [[nodiscard]] std::string encode_event(const JobEventBody& event) const override;
    [[nodiscard]] Progress decode_progress(std::string_view event) const override;
    [[nodiscard]] std::string encode_result(std::string_view spec,
                                            const JobResult& result) const override;
    [[nodiscard]] std::string encode_failure(const JobFailure& failure) const override;
};

}  // namespace remesh
