#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>

#include "client/commands/commands.h"
#include "client/follow.h"
#include "client/json.h"
#include "client/progress.h"
#include "client/tables.h"
#include "client/text.h"

namespace remesh::client {
namespace {

struct WatchArguments {
    std::string name;
    std::int64_t after = 0;
};

/// Says how to go on after Ctrl-C.
v1::Job follow_or_leave(const WatchArguments& arguments, Session& session,
                        const std::function<void(const v1::JobEvent&)>& on_event) {
    Connection& server = session.named_server();
    std::int64_t seen = arguments.after;
    try {
        return follow(server, arguments.name, arguments.after, [&](const v1::JobEvent& event) {
            seen = std::max(seen, event.sequence());
            on_event(event);
        });
    } catch (const Failure& failure) {
        if (failure.code() != ExitCode::Interrupted) {
            throw;
        }
        throw Failure(ExitCode::Interrupted,
                      fmt::format("left the job to itself; follow it again with\n"
                                  "  remesh --server {} watch {} --after {}",
                                  sanitised(server.server()), sanitised(arguments.name), seen));
    }
}

ExitCode watch(const WatchArguments& arguments, Session& session) {
    const bool is_json = session.settings().json;
    ProgressBar progress("", session.settings());
    const v1::Job job = follow_or_leave(arguments, session, [&](const v1::JobEvent& event) {
        if (is_json) {
            fmt::print("{}\n", json_line(event));
            std::fflush(stdout);
        } else if (event.has_warning()) {
            progress.clear();
            session.note("warning: " + sanitised(event.warning().message()));
        }
        progress.apply(event);
    });
    progress.clear();
    if (!is_json && !session.settings().quiet) {
        fmt::print("{}", job_card(job));
    }
    require_success(job);
    return ExitCode::Ok;
}

}  // namespace

void add_watch(CLI::App& app, Action& chosen) {
    CLI::App* command =
        app.add_subcommand("watch", "Follow a job to its end; its outcome is the exit status");
    const auto arguments = std::make_shared<WatchArguments>();
    command->add_option("JOB", arguments->name, "Name as printed by submit and list")
        ->type_name("NAME")
        ->required();
    command->add_option("--after", arguments->after, "Only events after this sequence")
        ->type_name("SEQUENCE")
        ->check(CLI::Validator(CLI::NonNegativeNumber).description(""));
    command->callback([arguments, &chosen] {
        chosen = [arguments](Session& session) { return watch(*arguments, session); };
    });
    command->footer("With --json, one event a line; Ctrl-C ends the watch, not the job.");
}

}  // namespace remesh::client
