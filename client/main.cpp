// remesh: the thin client. Flags in, one command, an exit status out.

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "client/commands/commands.h"
#include "client/config.h"
#include "client/text.h"

namespace {

using remesh::client::Action;
using remesh::client::ExitCode;
using remesh::client::Failure;
using remesh::client::Settings;

void add_global_options(CLI::App& app, Settings& settings) {
    app.set_version_flag("--version", "remesh " REMESH_VERSION, "Print the version and exit");
    app.add_option("--server", settings.server, "HOST:PORT or unix:PATH; absent: a private one")
        ->type_name("ADDRESS")
        ->envname("REMESH_SERVER");
    app.add_flag("--tls", settings.credentials.tls, "Speak TLS, trusting the system's authorities");
    app.add_option("--tls-ca", settings.credentials.ca, "PEM authorities of the server; speak TLS")
        ->type_name("FILE")
        ->envname("REMESH_TLS_CA");
    app.add_option("--tls-cert", settings.credentials.cert, "PEM certificate that shows who we are")
        ->type_name("FILE")
        ->envname("REMESH_TLS_CERT");
    app.add_option("--tls-key", settings.credentials.key, "PEM private key of the certificate")
        ->type_name("FILE")
        ->envname("REMESH_TLS_KEY");
    app.add_option("--token-file", settings.credentials.token_file,
                   "File with a token; without the flag REMESH_TOKEN is one, too")
        ->type_name("FILE")
        ->envname("REMESH_TOKEN_FILE");
    app.add_flag("--json", settings.json, "One JSON object a line on stdout");
    app.add_flag("-q,--quiet", settings.quiet, "Print errors only");
    app.add_flag_callback(
        "--no-color", [&] { settings.color = false; }, "No colours; NO_COLOR does the same");
    app.add_option("--timeout", settings.timeout, "Give up on a server that is silent for so long")
        ->type_name("SECONDS")
        ->check(CLI::Validator(CLI::NonNegativeNumber).description(""));
    app.add_option("--remeshd", settings.own_server.program, "Program of the private server")
        ->type_name("FILE")
        ->envname("REMESH_REMESHD");
    app.add_option("--threads", settings.own_server.threads, "Threads of the private server")
        ->type_name("N")
        ->check(CLI::Validator(CLI::PositiveNumber).description(""));
}

void add_commands(CLI::App& app, Action& chosen) {
    using namespace remesh::client;
    add_run(app, chosen);
    add_submit(app, chosen);
    add_watch(app, chosen);
    add_list(app, chosen);
    add_show(app, chosen);
    add_get(app, chosen);
    add_cancel(app, chosen);
    add_retry(app, chosen);
    add_delete(app, chosen);
    add_inspect(app, chosen);
    add_capabilities(app, chosen);
    add_completion(app, chosen);
    app.require_subcommand(1);
    for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
        command->fallthrough();  // Global options are welcome after the command, too.
    }
}

/// A secret is never a flag's value; the file that a flag names goes before the environment.
void take_token(Settings& settings, int argc, char** argv) {
    const bool names_file = std::any_of(argv, argv + argc, [](const char* word) {
        return std::string_view(word).starts_with("--token-file");
    });
    const char* token = std::getenv("REMESH_TOKEN");
    if (!names_file && token != nullptr) {
        settings.credentials.token = token;
    }
}

int fail(const Failure& failure) {
    std::fflush(stdout);
    fmt::print(stderr, "remesh: {}\n", failure.what());
    return static_cast<int>(failure.code());
}

int run_action(const Action& action, const Settings& settings) {
    remesh::client::Interrupts interrupts;
    remesh::client::Session session(settings, interrupts);
    try {
        const ExitCode code = action(session);
        if (std::fflush(stdout) != 0) {
            throw remesh::client::system_failure("can't write to stdout");
        }
        return static_cast<int>(code);
    } catch (const Failure& failure) {
        return fail(session.explained(failure));
    }
}

}  // namespace

int main(int argc, char** argv) {
    // A reader that has enough (`remesh list | head`) is an error of writing, not a signal: a
    // private server has to be stopped first.
    std::signal(SIGPIPE, SIG_IGN);
    // What the library has to say is in the status of the call.
    setenv("GRPC_VERBOSITY", "NONE", 0);

    CLI::App app("Turns damaged segmented surfaces into high-quality triangle and tet meshes.",
                 "remesh");
    Settings settings;
    Action action;
    add_global_options(app, settings);
    remesh::client::add_config(app);
    add_commands(app, action);
    app.footer(
        "Examples:\n"
        "  remesh run aorta.stl --edge-length 1.2 -o aorta.vtu -o aorta.ply\n"
        "  remesh run scans/*.stl --output-dir meshes\n"
        "  remesh --server meshes:50051 list\n"
        "\n"
        "Exit status: 0 ok, 1 trouble on this machine, 2 usage, 3 bad input, 4 job failed,\n"
        "5 cancelled, 6 server unavailable, 7 denied or over quota, 130 interrupted.");
    try {
        app.parse(argc, argv);
        take_token(settings, argc, argv);
    } catch (const CLI::Success& success) {  // --help and --version
        return app.exit(success);
    } catch (const CLI::ParseError& error) {
        return fail({ExitCode::Usage, error.what()});
    } catch (const Failure& failure) {
        return fail(failure);
    }
    try {
        return run_action(action, settings);
    } catch (const Failure& failure) {
        return fail(failure);
    } catch (const std::exception& error) {
        return fail({ExitCode::Local, error.what()});
    }
}
