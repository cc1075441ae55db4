#pragma once

#include <CLI/CLI.hpp>

#include "remesh/v1/options.pb.h"

namespace remesh::client {

/// Adds the flags that say how edge lengths vary; each writes its field of `sizing` when given.
/// `sizing` must outlive the parsing.
void add_sizing_options(CLI::App& command, v1::Sizing& sizing);

}  // namespace remesh::client
