#pragma once

#include <google/protobuf/duration.pb.h>

#include "remesh/v1/job.pb.h"
#include "server/jobs/job.h"
#include "server/store/job_record.h"

// Small values that several sources in this folder convert.

namespace remesh {

[[nodiscard]] v1::Job::State to_proto(JobState state);
[[nodiscard]] v1::Output::Kind to_proto(OutputKind kind);
[[nodiscard]] v1::Digest to_proto(const ArtifactId& artifact);
[[nodiscard]] v1::Progress to_proto(const Progress& from);
/// \param seconds  >= 0
[[nodiscard]] google::protobuf::Duration duration_of(double seconds);

}  // namespace remesh
