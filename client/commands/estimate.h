#pragma once

#include "client/create_job.h"
#include "client/session.h"

namespace remesh::client {

/// Has the server check a job of these files, and prints what it would need.
void tell_estimate(const JobFiles& files, const v1::JobSpec& spec, Connection& server,
                   const Settings& settings);

}  // namespace remesh::client
