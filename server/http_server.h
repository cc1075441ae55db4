#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/support/status.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "server/http/access.h"

namespace httplib {
class Server;
}

namespace remesh {

namespace http {
class Certificates;
class Gateway;
}  // namespace http

struct HttpOptions {
    std::string address{};  ///< HOST:PORT, port 0 for any.
    http::AccessRules access{};
    std::string tls_certificate{};  ///< PEM file, with tls_key; empty: plain HTTP.
    std::string tls_key{};
    std::chrono::milliseconds tls_refresh{10'000};  ///< The files are looked at so often.
};

/// The HTTP port: the dashboard and its API, metrics, and /healthz (the process lives) and /readyz
/// (it takes jobs) for probes that don't speak gRPC.
class HttpServer {
public:
    struct Sources {
        /// Where calls go, with the caller's own token. What answers them outlives close_api().
        std::shared_ptr<grpc::Channel> api{};
        std::function<bool()> is_ready{};
        std::function<std::string()> metrics{};  ///< In Prometheus' text format.
        /// Whether a token, or none, lets its bearer see the metrics, which are of all tenants.
        std::function<grpc::Status(const std::string&)> admit_to_metrics{};
        std::function<void(int)> count_response{};  ///< Called with the status of each answer.
    };

    /// \throws std::runtime_error if the address can't be listened on
    HttpServer(const HttpOptions& options, Sources sources);
    HttpServer(const HttpServer&) = delete;
    HttpServer& operator=(const HttpServer&) = delete;
    ~HttpServer();

    /// Ends event streams and answers calls with 503 from now on; probes and pages go on. Has to
    /// come before the API itself ends.
    void close_api();

    [[nodiscard]] int port() const { return port_; }

private:
    void add_probes();
    void bind(const std::string& address);

    Sources sources_;
    std::unique_ptr<http::Gateway> gateway_;
    std::unique_ptr<http::Certificates> certificates_;
    std::unique_ptr<httplib::Server> server_;
    int port_ = 0;
    std::jthread thread_;
};

}  // namespace remesh
