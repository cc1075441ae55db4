#pragma once

#include <CLI/CLI.hpp>

#include <functional>

namespace remesh {

/// Adds `admin`: tokens, certificates and the audit log of a data directory, whether a server runs
/// on it or not. Parsing one of its commands sets `chosen` to what then gives the exit status.
void add_admin(CLI::App& app, std::function<int()>& chosen);

}  // namespace remesh
