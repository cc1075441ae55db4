#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "client/unique_fd.h"

namespace remesh::client {

struct PrivateServerOptions {
    std::optional<std::filesystem::path> program{};  ///< The server's program; absent: found.
    int threads = 0;                                 ///< Of a job; 0 leaves it to the server.
};

/// A server of our own for one command: on a Unix socket in a folder that only this user can
/// enter, gone with the command.
///
/// The child dies with us whatever kills us. Its folder then stays behind, locked by nobody, and
/// the next private server of this user removes it. Stopping reaps the child, so that its CPU time
/// and memory count as this process's children's.
class PrivateServer {
public:
    /// Returns once the server listens.
    ///
    /// \throws Failure{Local} if there is no server program or it doesn't start
    /// \throws Failure{Interrupted} if asked to stop
    PrivateServer(const PrivateServerOptions& options, const std::stop_token& stop);
    ~PrivateServer();
    PrivateServer(const PrivateServer&) = delete;
    PrivateServer& operator=(const PrivateServer&) = delete;

    [[nodiscard]] std::string address() const { return "unix:" + socket().string(); }

    /// Why the server is gone, if it is: "was killed by signal 9: LAST LINE OF ITS LOG".
    [[nodiscard]] std::optional<std::string> post_mortem();

private:
    [[nodiscard]] std::filesystem::path socket() const { return folder_ / "s"; }
    [[nodiscard]] std::filesystem::path log() const { return folder_ / "log"; }
    void start(const std::filesystem::path& program, int threads);
    void wait_until_listening(const std::stop_token& stop);
    bool has_exited();
    void stop();

    std::filesystem::path folder_;
    UniqueFd lock_;  ///< Held by the child, too: the folder is in use while either lives.
    pid_t child_ = -1;
    int exit_status_ = 0;
};

/// Finds the server's program beside the client's, where it is built or installed, or on the PATH.
[[nodiscard]] std::optional<std::filesystem::path> find_server_program();

}  // namespace remesh::client
