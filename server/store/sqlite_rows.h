#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/store/job_record.h"
#include "server/store/sqlite.h"

// Rows of the tables as records and back. What writes is for use inside a transaction.

namespace remesh::sqlite {

/// \throws StoreError if no state has that name
[[nodiscard]] JobState state_of(std::string_view name);
[[nodiscard]] std::int64_t to_row(Time time);
[[nodiscard]] Time to_time(std::int64_t row);

/// "SELECT … FROM jobs " and `rest`, for `job_of`.
[[nodiscard]] std::string select_jobs(std::string_view rest);
[[nodiscard]] JobRecord job_of(const Statement& row);
[[nodiscard]] StoredEvent event_of(const Statement& row);

[[nodiscard]] std::optional<JobRecord> find_job(Connection& connection, const JobKey& key);
/// The job, if the claim may still write to it.
[[nodiscard]] std::optional<JobRecord> find_claimed(Connection& connection, const Claim& claim);
[[nodiscard]] std::optional<ArtifactId> find_artifact(Connection& connection,
                                                      const std::string& tenant,
                                                      const std::string& sha256);
[[nodiscard]] TenantPolicy find_policy(Connection& connection, const std::string& tenant);
[[nodiscard]] std::int64_t stored_bytes(Connection& connection, const std::string& tenant);

void insert_job(Connection& connection, const NewJob& job, Time now);
/// Makes the job what it becomes: the State event and the row.
void enter(Connection& connection, JobRecord& job, JobState state, Time now);
void append_events(Connection& connection, JobRecord& job, std::span<const NewEvent> events);
void insert_artifact(Connection& connection, const std::string& tenant, const ArtifactId& artifact,
                     Time now);
void refer(Connection& connection, const JobRecord& job, std::string_view role,
           const std::string& sha256);

}  // namespace remesh::sqlite
