#pragma once

#include <string>
#include <vector>

#include "remesh/v1/artifact.pb.h"
#include "remesh/v1/capability.pb.h"
#include "remesh/v1/job.pb.h"

namespace remesh::client {

/// Before and after, deviation, defects and what was done about them: what a person asks first.
[[nodiscard]] std::string quality_table(const v1::Quality& quality);

/// One job a row, newest first.
[[nodiscard]] std::string jobs_table(const std::vector<v1::Job>& jobs);

/// One job: where it stands, what was asked for, what came out.
[[nodiscard]] std::string job_card(const v1::Job& job);

/// What a job of a file would need. \param title  the file's name, safe to print
[[nodiscard]] std::string estimate_card(const std::string& title, const v1::Estimate& estimate);

/// One finished job a row, for a batch.
[[nodiscard]] std::string batch_table(const std::vector<v1::Job>& jobs);

/// What a file holds. \param title  its name, safe to print
[[nodiscard]] std::string inspection_card(const std::string& title,
                                          const v1::Inspection& inspection);

[[nodiscard]] std::string capabilities_card(const v1::GetCapabilitiesResponse& server);

/// Seconds from start to end of the last attempt; 0 if it hasn't ended.
[[nodiscard]] double run_seconds(const v1::Job& job);

}  // namespace remesh::client
