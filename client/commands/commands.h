#pragma once

#include <CLI/CLI.hpp>

#include <functional>

#include "client/failure.h"
#include "client/session.h"

namespace remesh::client {

/// What a parsed command line asks for.
using Action = std::function<ExitCode(Session&)>;

// Each adds its subcommand to `app`; parsing that subcommand sets `chosen`.
void add_run(CLI::App& app, Action& chosen);
void add_submit(CLI::App& app, Action& chosen);
void add_watch(CLI::App& app, Action& chosen);
void add_list(CLI::App& app, Action& chosen);
void add_show(CLI::App& app, Action& chosen);
void add_get(CLI::App& app, Action& chosen);
void add_cancel(CLI::App& app, Action& chosen);
void add_retry(CLI::App& app, Action& chosen);
void add_delete(CLI::App& app, Action& chosen);
void add_inspect(CLI::App& app, Action& chosen);
void add_capabilities(CLI::App& app, Action& chosen);
/// To be added last: it completes what `app` has by then.
void add_completion(CLI::App& app, Action& chosen);

}  // namespace remesh::client
