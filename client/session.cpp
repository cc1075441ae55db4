#include "client/session.h"

#include <fmt/format.h>

#include <cstdio>
#include <unistd.h>
#include <utility>

#include "client/text.h"

namespace remesh::client {
namespace {

/// A private server never restarts; it may be slow on a busy machine, and it's known when it dies.
constexpr Connection::Milliseconds kPrivatePatience = std::chrono::seconds(20);

}  // namespace

Connection& Session::named_server() {
    if (is_private()) {
        throw Failure(ExitCode::Usage,
                      "this needs a server: give --server HOST:PORT or set REMESH_SERVER");
    }
    return connect(settings_.server);
}

Connection& Session::any_server() {
    if (!is_private()) {
        return named_server();
    }
    if (!private_server_) {
        private_server_.emplace(settings_.own_server, interrupts_.first());
    }
    return connect(private_server_->address());
}

Connection& Session::connect(const std::string& server) {
    if (!connection_) {
        ServerSettings to{server, {}, {}, {}};
        if (settings_.timeout) {
            to.patience = Connection::Milliseconds(
                static_cast<Connection::Milliseconds::rep>(*settings_.timeout * 1e3));
        } else if (is_private()) {
            to.patience = kPrivatePatience;
        }
        if (is_private()) {
            to.is_gone = [this] { return private_server_->post_mortem().has_value(); };
        } else {
            to.credentials = settings_.credentials;
        }
        connection_.emplace(std::move(to), interrupts_.first());
        connection_->set_on_silence([this, server](Connection::Milliseconds longest) {
            note(fmt::format("waiting for the server at {}, for {} at most", sanitised(server),
                             duration_word(static_cast<double>(longest.count()) / 1e3)));
        });
    }
    return *connection_;
}

void Session::note(const std::string& line) const {
    if (!settings_.quiet) {
        const char* clear_progress = isatty(STDERR_FILENO) == 1 ? "\r\x1b[K" : "";
        fmt::print(stderr, "{}{}\n", clear_progress, line);
    }
}

Failure Session::explained(const Failure& failure) {
    if (private_server_ && failure.code() == ExitCode::Unavailable) {
        if (const auto reason = private_server_->post_mortem()) {
            return {ExitCode::JobFailed, "the private server " + *reason};
        }
    }
    return failure;
}

}  // namespace remesh::client
