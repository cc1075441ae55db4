#pragma once

#include <CLI/CLI.hpp>

namespace remesh::client {

/// Lets `app` take its global options from a file too: --config FILE, or
/// $XDG_CONFIG_HOME/remesh/config.toml (~/.config/remesh/config.toml) if that is there.
///
/// Lines are `option = value`, options named as the flags are without their dashes. Flags go before
/// the environment, and that before the file.
void add_config(CLI::App& app);

}  // namespace remesh::client
