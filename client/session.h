#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>

#include "client/connection.h"
#include "client/failure.h"
#include "client/interrupts.h"
#include "client/private_server.h"

namespace remesh::client {

/// What the global flags and the environment say.
struct Settings {
    std::string server{};             ///< "HOST:PORT", "unix:PATH" or empty.
    bool json = false;                ///< One JSON object a line on stdout.
    bool quiet = false;               ///< Errors and what was asked for, nothing else.
    bool color = true;                ///< Colours on a terminal.
    std::optional<double> timeout{};  ///< Patience with a silent server, seconds.
    Credentials credentials{};        ///< For the named server.
    PrivateServerOptions own_server{};
};

/// One command's run: its settings and its way to a server, private if none was named.
class Session {
public:
    Session(const Settings& settings, Interrupts& interrupts)
        : settings_(settings), interrupts_(interrupts) {}

    /// The named server. \throws Failure{Usage} if none was named
    Connection& named_server();
    /// The named server, or a private one, started on the first call.
    Connection& any_server();

    [[nodiscard]] const Settings& settings() const { return settings_; }
    [[nodiscard]] const Interrupts& interrupts() const { return interrupts_; }
    [[nodiscard]] bool is_private() const { return settings_.server.empty(); }

    /// Prints a line on stderr for the person there; not when quiet.
    void note(const std::string& line) const;

    /// The failure as it should be told: a private server that died explains it better.
    [[nodiscard]] Failure explained(const Failure& failure);

private:
    Connection& connect(const std::string& server);

    const Settings& settings_;
    Interrupts& interrupts_;
    std::optional<PrivateServer> private_server_;
    std::optional<Connection> connection_;  // After the server: closed before it stops.
};

}  // namespace remesh::client
