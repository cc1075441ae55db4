#include <fmt/format.h>

#include <cstdio>

#include "client/commands/commands.h"
#include "client/json.h"
#include "client/tables.h"

namespace remesh::client {
namespace {

ExitCode show_capabilities(Session& session) {
    const v1::GetCapabilitiesResponse server = session.any_server().capabilities();
    if (session.settings().json) {
        fmt::print("{}\n", json_line(server));
    } else {
        fmt::print("{}", capabilities_card(server));
    }
    return ExitCode::Ok;
}

}  // namespace

void add_capabilities(CLI::App& app, Action& chosen) {
    CLI::App* command = app.add_subcommand(
        "capabilities", "Print what the server can do: formats, defaults, limits");
    command->callback([&chosen] { chosen = show_capabilities; });
}

}  // namespace remesh::client
