#include "server/http_server.h"

#include <charconv>
#include <httplib.h>
#include <stdexcept>
#include <utility>

namespace remesh {

HttpServer::HttpServer(const std::string& address, std::function<bool()> is_ready)
    : server_(std::make_unique<httplib::Server>()) {
    server_->Get("/healthz", [](const httplib::Request&, httplib::Response& response) {
        response.set_content("ok\n", "text/plain");
    });
    server_->Get("/readyz", [is_ready = std::move(is_ready)](const httplib::Request&,
                                                             httplib::Response& response) {
        response.status = is_ready() ? 200 : 503;
        response.set_content(is_ready() ? "ready\n" : "shutting down\n", "text/plain");
    });
    const auto colon = address.rfind(':');
    int port = 0;
    if (colon != std::string::npos) {
        std::from_chars(address.data() + colon + 1, address.data() + address.size(), port);
    }
    if (port < 1 || port > 65'535 || !server_->bind_to_port(address.substr(0, colon), port)) {
        throw std::runtime_error("can't listen on " + address + " for HTTP");
    }
    thread_ = std::jthread([this] { server_->listen_after_bind(); });
    // A stop before it runs would be forgotten.
    while (!server_->is_running()) {
        std::this_thread::yield();
    }
}

HttpServer::~HttpServer() {
    server_->stop();
}

}  // namespace remesh
