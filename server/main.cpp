#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <string>

#include "server/admin.h"
#include "server/call.h"
#include "server/convert.h"
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

// What the command line is answered with that can't be understood; as the client does.
constexpr int kUsage = 2;
// SIGTERM to exit; Docker's own grace is 10 s.
constexpr std::chrono::seconds kShutdownGrace{7};

struct ServeFlags {
    ServerOptions server{};
    remesh::WorkFlags work{};
    std::string http{};
    std::string port_file{};
    std::string http_port_file{};
    int keep_jobs_days = 0;
    std::int64_t keep_uploads_hours =
        std::chrono::floor<std::chrono::hours>(remesh::HousekeeperOptions{}.keep_uploads).count();
    bool allows_any_address = false;
};

void add_serve_flags(CLI::App& serve, ServeFlags& flags) {
    ServerOptions& server = flags.server;
    remesh::add_work_flags(serve, flags.work, 0);
    serve.add_option("--listen", server.listen, "HOST:PORT (port 0: any) or unix:PATH")
        ->capture_default_str();
    serve.add_option("--http", flags.http,
                     "HOST:PORT for the dashboard, /metrics, /healthz and /readyz (port 0: any)");
    serve.add_option("--max-queued", server.registry.limits.max_queued, "Jobs that may wait")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000}))
        ->capture_default_str();
    serve.add_option("--max-connections", server.max_connections, "More are closed as they come")
        ->check(CLI::Range(1, 1'000'000))
        ->capture_default_str();
    serve.add_option("--max-artifact-bytes", server.max_artifact_bytes, "Largest upload")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000'000'000'000}))
        ->capture_default_str();
    serve
        .add_option("--tenant-max-queued", server.registry.limits.max_queued_of_tenant,
                    "Jobs of one tenant that may wait")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000}))
        ->capture_default_str();
    serve
        .add_option("--tenant-max-bytes", server.registry.limits.max_bytes_of_tenant,
                    "Bytes that one tenant may keep, inputs and results")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000'000'000'000'000}))
        ->default_str("no limit");
    serve
        .add_option("--keep-jobs", flags.keep_jobs_days,
                    "Days after which finished jobs and their files are deleted")
        ->check(CLI::Range(1, 36'500))
        ->default_str("never");
    serve
        .add_option("--keep-uploads", flags.keep_uploads_hours,
                    "Hours after which uploads that no job needs are deleted")
        ->check(CLI::Range(1, 876'000))
        ->capture_default_str();
    serve.add_option("--port-file", flags.port_file, "Gets the chosen port once it's open");
    serve.add_option("--http-port-file", flags.http_port_file, "The same of --http");
    serve.add_flag("--reflection", server.with_reflection, "Serve gRPC reflection");
    serve.add_flag("--insecure-bind", flags.allows_any_address,
                   "Listen beyond this machine without TLS and credentials: a proxy sees to both");
    serve.add_flag("--auth", server.requires_credentials,
                   "Every call needs a token or a client certificate (remeshd admin)");
    auto* certificate =
        serve.add_option("--tls-cert", server.tls.certificate, "PEM certificate chain; speak TLS");
    auto* key = serve.add_option("--tls-key", server.tls.key, "PEM private key of the certificate");
    certificate->needs(key);
    key->needs(certificate);
    serve
        .add_option("--tls-client-ca", server.tls.client_ca,
                    "PEM authorities that client certificates may come from")
        ->needs(certificate);
}

/// Whoever waits for the file never sees half of it.
void write_port(const std::filesystem::path& file, int port) {
    auto draft = file;
    draft += ".new";
    std::ofstream(draft) << port << '\n';
    std::error_code error;
    std::filesystem::rename(draft, file, error);
    if (error) {
        throw std::runtime_error("can't write " + file.string() + ": " + error.message());
    }
}

/// Empty if there is no such file.
std::string content_of(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

void require_address(const std::string& name, const std::string& address) {
    if (!remesh::is_address(address)) {
        throw std::runtime_error(name + " must be HOST:PORT (or unix:PATH), got " + address);
    }
}

/// What may be reached from other machines must be private and must ask who calls.
void require_safe(const std::string& address, bool is_safe) {
    if (!is_safe && !remesh::is_loopback(address)) {
        throw std::runtime_error(
            address +
            " can be reached from other machines: say --tls-cert, --tls-key and --auth; or put a "
            "proxy before it that does both and say --insecure-bind; or listen on 127.0.0.1");
    }
}

/// A connection is a file.
void raise_file_limit() {
    rlimit files{};
    if (::getrlimit(RLIMIT_NOFILE, &files) == 0) {
        files.rlim_cur = files.rlim_max;
        ::setrlimit(RLIMIT_NOFILE, &files);
    }
}

remesh::HttpOptions http_options_of(const ServeFlags& flags) {
    const bool is_local = remesh::is_loopback(flags.http);
    remesh::HttpOptions options{.address = flags.http, .access = {.loopback_only = is_local}};
    if (!is_local && flags.server.tls.is_on()) {
        options.tls_certificate = flags.server.tls.certificate;
        options.tls_key = flags.server.tls.key;
        options.access.is_encrypted = true;
    }
    return options;
}

remesh::HttpServer::Sources http_sources_of(Server& server) {
    return {.api = server.in_process_channel(),
            .is_ready = [&server] { return server.is_ready(); },
            .metrics = [&server] { return server.metrics().text(); },
            .admit_to_metrics =
                [&server](const std::string& token) {
                    return remesh::admission(server.gate(), token, remesh::Role::Operator,
                                             "metrics");
                },
            .count_response = [&server](int status) { server.metrics().count_response(status); }};
}

int serve(ServeFlags flags) {
    remesh::set_up_log(flags.work.log_level);
    require_address("--listen", flags.server.listen);
    if (!flags.http.empty()) {
        require_address("--http", flags.http);
    }
    if (!flags.allows_any_address) {
        require_safe(flags.server.listen,
                     flags.server.tls.is_on() && flags.server.requires_credentials);
        if (!flags.http.empty()) {
            require_safe(flags.http, flags.server.tls.is_on() && flags.server.requires_credentials);
        }
    }
    raise_file_limit();
    remesh::block_signals();
    complete(flags.work);
    flags.server.data_dir = flags.work.data_dir;
    flags.server.workforce = workforce_options(flags.work);
    flags.server.registry.workers = std::max(1, flags.work.workers.workers);
    flags.server.housekeeping.keep_uploads = std::chrono::hours(flags.keep_uploads_hours);
    if (flags.keep_jobs_days > 0) {
        flags.server.housekeeping.keep_jobs = std::chrono::hours(24) * flags.keep_jobs_days;
    }
    flags.server.inspector = remesh::inspector_in_child("/proc/self/exe");
    flags.server.registry.estimator = remesh::estimator_in_child("/proc/self/exe");

    const remesh::RemeshEngine engine(max_job_bytes(flags.work), remesh::option_rows);
    Server server(flags.server, engine);
    std::optional<remesh::HttpServer> http;
    if (!flags.http.empty()) {
        http.emplace(http_options_of(flags), http_sources_of(server));
        spdlog::info("event=serving_http address={} port={}", flags.http, http->port());
    }
    if (http && !flags.http_port_file.empty()) {
        write_port(flags.http_port_file, http->port());
    }
    if (!flags.port_file.empty()) {
        write_port(flags.port_file, server.port());
    }
    spdlog::info("event=serving version={} listen={} port={} workers={} threads={}",
                 remesh::kVersion, flags.server.listen, server.port(), flags.work.workers.workers,
                 flags.work.workers.threads);

    spdlog::info("event=stopping signal={}", remesh::wait_for_signal());
    if (http) {
        http->close_api();
    }
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
    remesh::add_admin(app, chosen);

    std::string health_address = ServerOptions{}.listen;
    auto* health_command =
        app.add_subcommand("healthcheck", "Exit with 0 if a server takes calls, else with 1");
    health_command->add_option("--server", health_address, "HOST:PORT or unix:PATH")
        ->capture_default_str();
    std::string health_ca;
    health_command->add_option("--tls-ca", health_ca, "PEM authority of a server that speaks TLS")
        ->check(CLI::ExistingFile);

    // For `serve` itself: it looks at files in a process of its own.
    std::string inspection_hint;
    auto* inspect_command = app.add_subcommand("inspect-stdin", "")->group("");
    inspect_command->add_option("--hint", inspection_hint);
    auto* estimate_command = app.add_subcommand("estimate-stdin", "")->group("");

    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == EXIT_SUCCESS ? EXIT_SUCCESS : kUsage;
    }
    try {
        if (chosen) {
            return chosen();
        }
        if (inspect_command->parsed()) {
            return remesh::serve_inspection(inspection_hint);
        }
        if (estimate_command->parsed()) {
            return remesh::serve_estimate(remesh::RemeshEngine());
        }
        if (health_command->parsed()) {
            return remesh::is_serving(health_address, content_of(health_ca)) ? EXIT_SUCCESS
                                                                             : EXIT_FAILURE;
        }
        return serve(std::move(flags));
    } catch (const std::exception& error) {
        std::cerr << "remeshd: " << error.what() << '\n';
        return EXIT_FAILURE;
    }
}
