#pragma once

#include <CLI/CLI.hpp>

#include "remesh/v1/job.pb.h"

namespace remesh::client {

/// Adds every flag that says how to remesh; each writes its field of `spec` when it is given.
///
/// A flag that isn't given leaves its field absent, so that the defaults stay the server's.
/// `spec` must outlive the parsing.
void add_job_options(CLI::App& command, v1::JobSpec& spec);

}  // namespace remesh::client
