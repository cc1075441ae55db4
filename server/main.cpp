#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "server/healthcheck.h"
#include "server/http_server.h"
#include "server/jobs/remesh_engine.h"
#include "server/logging.h"
#include "server/machine.h"
#include "server/server.h"
#include "server/version.h"
#include "server/work.h"

namespace {

using remesh::Server;
using remesh::ServerOptions;

// SIGTERM to exit; Docker's own grace is 10 s.
constexpr std::chrono::seconds kShutdownGrace{7};

struct ServeFlags {
    ServerOptions server{};
    remesh::WorkFlags work{};
    std::string http{};
    std::string port_file{};
    int keep_jobs_days = 0;
    int keep_uploads_hours = 24;
    bool allows_any_address = false;
};

void add_serve_flags(CLI::App& serve, ServeFlags& flags) {
    ServerOptions& server = flags.server;
    remesh::add_work_flags(serve, flags.work, 0);
    serve.add_option("--listen", server.listen, "HOST:PORT (port 0: any) or unix:PATH")
        ->capture_default_str();
    serve.add_option("--http", flags.http, "HOST:PORT for /healthz and /readyz");
    serve.add_option("--max-queued", server.registry.limits.max_queued, "Jobs that may wait")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000}))
        ->capture_default_str();
    serve.add_option("--max-artifact-bytes", server.max_artifact_bytes, "Largest upload")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    serve
        .add_option("--tenant-max-queued", server.registry.limits.max_queued_of_tenant,
                    "Jobs of one tenant that may wait")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000}))
        ->capture_default_str();
    serve
        .add_option("--tenant-max-bytes", server.registry.limits.max_bytes_of_tenant,
                    "Bytes that one tenant may keep, inputs and results")
        ->check(CLI::PositiveNumber)
        ->default_str("no limit");
    serve
        .add_option("--keep-jobs", flags.keep_jobs_days,
                    "Days after which finished jobs and their files are deleted")
        ->check(CLI::PositiveNumber)
        ->default_str("never");
    serve
        .add_option("--keep-uploads", flags.keep_uploads_hours,
                    "Hours after which uploads that no job needs are deleted")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    serve.add_option("--port-file", flags.port_file, "Gets the chosen port once it's open");
    serve.add_flag("--reflection", server.with_reflection, "Serve gRPC reflection");
    serve.add_flag("--insecure-bind", flags.allows_any_address,
                   "Listen beyond this machine without TLS: a proxy does it");
}

/// Whoever waits for the file never sees half of it.
void write_port(const std::filesystem::path& file, int port) {
    auto draft = file;
    draft += ".new";
    std::ofstream(draft) << port << '\n';
    std::filesystem::rename(draft, file);
}

void require_loopback(const std::string& address) {
    if (!remesh::is_loopback(address)) {
        throw std::runtime_error(
            address +
            " can be reached from other machines and remeshd speaks no TLS; put a proxy before it "
            "and say --insecure-bind, or listen on 127.0.0.1");
    }
}

int serve(ServeFlags flags) {
    remesh::set_up_log(flags.work.log_level);
    if (!flags.allows_any_address) {
        require_loopback(flags.server.listen);
        if (!flags.http.empty()) {
            require_loopback(flags.http);
        }
    }
    remesh::block_signals();
    complete(flags.work);
    flags.server.data_dir = flags.work.data_dir;
    flags.server.workforce = workforce_options(flags.work);
    flags.server.registry.workers = std::max(1, flags.work.workers.workers);
    flags.server.housekeeping.keep_uploads = std::chrono::hours(flags.keep_uploads_hours);
    if (flags.keep_jobs_days > 0) {
        flags.server.housekeeping.keep_jobs = std::chrono::hours(24) * flags.keep_jobs_days;
    }

    const remesh::RemeshEngine engine(max_job_bytes(flags.work));
    Server server(flags.server, engine);
    std::optional<remesh::HttpServer> http;
    if (!flags.http.empty()) {
        http.emplace(flags.http, [&server] { return server.is_ready(); });
    }
    if (!flags.port_file.empty()) {
        write_port(flags.port_file, server.port());
    }
    spdlog::info("event=serving version={} listen={} port={} workers={} threads={}",
                 remesh::kVersion, flags.server.listen, server.port(), flags.work.workers.workers,
                 flags.work.workers.threads);

    spdlog::info("event=stopping signal={}", remesh::wait_for_signal());
    const bool is_idle = server.shut_down(kShutdownGrace);
    spdlog::info("event=stopped");
    if (!is_idle) {
        // A run hangs in code that can't be asked to stop. Its job is back in the queue.
        std::_Exit(EXIT_SUCCESS);
    }
    return EXIT_SUCCESS;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("remeshd: remeshes medical surfaces, as a service");
    app.set_version_flag("--version", std::string("remeshd ") + remesh::kVersion);
    app.require_subcommand(1);

    ServeFlags flags;
    auto* serve_command = app.add_subcommand("serve", "Serve the API and run jobs");
    add_serve_flags(*serve_command, flags);

    std::function<int()> chosen;
    remesh::add_work(app, chosen);

    std::string health_address = "127.0.0.1:50051";
    auto* health_command =
        app.add_subcommand("healthcheck", "Exit with 0 if a server takes calls, else with 1");
    health_command->add_option("--server", health_address, "HOST:PORT or unix:PATH")
        ->capture_default_str();

    CLI11_PARSE(app, argc, argv);
    try {
        if (health_command->parsed()) {
            return remesh::is_serving(health_address) ? EXIT_SUCCESS : EXIT_FAILURE;
        }
        if (chosen) {
            return chosen();
        }
        return serve(std::move(flags));
    } catch (const std::exception& error) {
        std::cerr << "remeshd: " << error.what() << '\n';
        return EXIT_FAILURE;
    }
}
