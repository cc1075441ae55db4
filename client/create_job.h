#pragma once

#include <string>

#include "client/connection.h"
#include "client/transfer.h"

namespace remesh::client {

/// What a job is made of.
struct JobFiles {
    const InputFile& surface;
    const InputFile* size_image = nullptr;  ///< If there is one.
};

/// Uploads files and creates a job for them, with `spec` for everything else.
///
/// The request carries a random id, so that a call that is tried again makes no second job.
[[nodiscard]] v1::Job create_job(Connection& connection, const JobFiles& files, v1::JobSpec spec);

/// Uploads files and has the server check the job, without making it. \return with an estimate
[[nodiscard]] v1::Job estimate_job(Connection& connection, const JobFiles& files, v1::JobSpec spec);

/// Has a job that went wrong run again, as a new job.
[[nodiscard]] v1::Job retry_job(Connection& connection, const std::string& name);

}  // namespace remesh::client
