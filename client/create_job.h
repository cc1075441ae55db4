#pragma once

#include "client/connection.h"
#include "client/transfer.h"

namespace remesh::client {

/// Uploads `file` and creates a job for it, with `spec` for everything else.
///
/// The request carries a random id, so that a call that is tried again makes no second job.
[[nodiscard]] v1::Job create_job(Connection& connection, const InputFile& file, v1::JobSpec spec);

}  // namespace remesh::client
