#pragma once

#include <grpcpp/support/status.h>

#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "remesh/v1/capability.pb.h"
#include "remesh/v1/job.pb.h"
#include "server/jobs/codec.h"
#include "server/jobs/registry.h"

// The one place that knows both proto and core. Its sources are in convert/, by topic.

namespace remesh {

/// The only tenant there is without authentication.
inline constexpr std::string_view kDefaultTenant = "default";

// Names. All throw JobError{BadRequest}.

[[nodiscard]] JobKey job_key_of(const std::string& name);
[[nodiscard]] std::string tenant_of(const std::string& parent);
[[nodiscard]] std::string job_name(const JobKey& key);
[[nodiscard]] std::int64_t revision_of(const std::string& etag);

// Requests.

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
[[nodiscard]] v1::Quality to_proto(const QualityReport& report);
[[nodiscard]] v1::Format to_proto(MeshFormat format);
[[nodiscard]] v1::Stage to_proto(Stage stage);
[[nodiscard]] google::protobuf::Timestamp to_proto(Time time);

/// The path in a CreateJobRequest of what the engine calls `field`.
[[nodiscard]] std::string proto_field(const std::string& field);

// Errors.

/// What an exception of a handler means to the caller, with google.rpc details.
[[nodiscard]] grpc::Status to_status(const std::exception_ptr& error);
[[nodiscard]] grpc::Status shutting_down_status();
[[nodiscard]] grpc::Status artifact_not_found_status(const std::string& sha256);
[[nodiscard]] grpc::Status too_many_status(const std::string& subject,
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
