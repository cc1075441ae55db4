#pragma once

#include "client/session.h"
#include "client/transfer.h"

namespace remesh::client {

/// Has the server check a job of `file`, and prints what it would need.
void tell_estimate(const InputFile& file, const v1::JobSpec& spec, Connection& server,
                   const Settings& settings);

}  // namespace remesh::client
