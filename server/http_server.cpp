#include "server/http_server.h"

#include <charconv>
#include <httplib.h>
#include <stdexcept>
#include <utility>

#include "server/http/call.h"
#include "server/http/certificates.h"
#include "server/http/gateway.h"
#include "server/http/pages.h"
#include "server/http/respond.h"
#include "server/http/task_queue.h"

namespace remesh {
namespace {

// Event streams hold one each; the rest is for calls.
constexpr std::size_t kMaxThreads = 256;
constexpr time_t kReadTimeoutSeconds = 30;
constexpr time_t kWriteTimeoutSeconds = 30;
constexpr time_t kKeepAliveSeconds = 5;

std::unique_ptr<http::Certificates> read_certificates(const HttpOptions& options) {
    return options.tls_certificate.empty()
               ? nullptr
               : std::make_unique<http::Certificates>(options.tls_certificate, options.tls_key,
                                                      options.tls_refresh);
}

std::unique_ptr<httplib::Server> make_server(const HttpOptions& options,
                                             http::Certificates* certificates) {
    if (certificates == nullptr) {
        return std::make_unique<httplib::Server>();
    }
    auto server = std::make_unique<httplib::SSLServer>(options.tls_certificate.c_str(),
                                                       options.tls_key.c_str());
    if (!server->is_valid()) {
        throw std::runtime_error("can't use the TLS certificate " + options.tls_certificate +
                                 " and its key for HTTP");
    }
    certificates->serve(server->ssl_context());
    return server;
}

}  // namespace

HttpServer::HttpServer(const HttpOptions& options, Sources sources)
    : sources_(std::move(sources)),
      gateway_(std::make_unique<http::Gateway>(sources_.api, options.access)),
      certificates_(read_certificates(options)),
      server_(make_server(options, certificates_.get())) {
    server_->new_task_queue = [] { return new http::TaskQueue(kMaxThreads); };
    server_->set_read_timeout(kReadTimeoutSeconds);
    server_->set_write_timeout(kWriteTimeoutSeconds);
    server_->set_keep_alive_timeout(kKeepAliveSeconds);
    server_->set_tcp_nodelay(true);
    server_->set_pre_routing_handler(
        [access = options.access](const httplib::Request& request, httplib::Response& response) {
            const bool is_probe = request.path == "/healthz" || request.path == "/readyz";
            return is_probe || http::admit(access, request, response)
                       ? httplib::Server::HandlerResponse::Unhandled
                       : httplib::Server::HandlerResponse::Handled;
        });
    server_->set_post_routing_handler([](const httplib::Request&, httplib::Response& response) {
        http::add_security_headers(response);
    });
    server_->set_logger([this](const httplib::Request&, const httplib::Response& response) {
        sources_.count_response(response.status);
    });
    // What went wrong inside may quote data: it goes nowhere.
    server_->set_exception_handler(
        [](const httplib::Request&, httplib::Response& response, const std::exception_ptr& thrown) {
            try {
                std::rethrow_exception(thrown);
            } catch (const http::ShuttingDown&) {
                response.set_header("Retry-After", "5");
                http::refuse(response, 503, "SHUTTING_DOWN", "The server is shutting down.");
            } catch (...) {
                http::refuse(response, 500, "INTERNAL", "The server failed; this is a defect.");
            }
        });
    add_probes();
    gateway_->add_routes(*server_);
    http::add_pages(*server_);
    bind(options.address);
    thread_ = std::jthread([this] { server_->listen_after_bind(); });
    // A stop before it runs would be forgotten.
    while (!server_->is_running()) {
        std::this_thread::yield();
    }
}

void HttpServer::close_api() {
    gateway_->close();
}

HttpServer::~HttpServer() {
    close_api();
    server_->stop();
}

void HttpServer::add_probes() {
    server_->Get("/healthz", [](const httplib::Request&, httplib::Response& response) {
        response.set_content("ok\n", "text/plain");
    });
    server_->Get("/readyz", [this](const httplib::Request&, httplib::Response& response) {
        const bool is_ready = sources_.is_ready();
        response.status = is_ready ? 200 : 503;
        response.set_content(is_ready ? "ready\n" : "shutting down\n", "text/plain");
    });
    server_->Get("/metrics", [this](const httplib::Request& request, httplib::Response& response) {
        const auto status = sources_.admit_to_metrics
                                ? sources_.admit_to_metrics(http::token_of(request))
                                : gateway_->check(http::token_of(request));
        if (!status.ok()) {
            http::refuse(response, status);
            return;
        }
        http::send(response, sources_.metrics(), "text/plain; version=0.0.4; charset=utf-8");
    });
}

void HttpServer::bind(const std::string& address) {
    const auto colon = address.rfind(':');
    int port = -1;
    if (colon != std::string::npos) {
        std::from_chars(address.data() + colon + 1, address.data() + address.size(), port);
    }
    if (port >= 0 && port <= 65'535) {
        std::string host = address.substr(0, colon);
        if (host.starts_with('[') && host.ends_with(']')) {
            host = host.substr(1, host.size() - 2);
        }
        port_ = port == 0 ? server_->bind_to_any_port(host)
                          : (server_->bind_to_port(host, port) ? port : 0);
    }
    if (port_ < 1) {
        throw std::runtime_error("can't listen on " + address + " for HTTP");
    }
}

}  // namespace remesh
