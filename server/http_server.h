#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace httplib {
class Server;
}

namespace remesh {

/// Answers /healthz (the process lives) and /readyz (it takes jobs) for probes that don't speak
/// gRPC.
class HttpServer {
public:
    /// \param address  HOST:PORT
    /// \throws std::runtime_error if it can't be listened on
    HttpServer(const std::string& address, std::function<bool()> is_ready);
    HttpServer(const HttpServer&) = delete;
    HttpServer& operator=(const HttpServer&) = delete;
    ~HttpServer();

private:
    std::unique_ptr<httplib::Server> server_;
    std::jthread thread_;
};

}  // namespace remesh
