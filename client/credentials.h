#pragma once

#include <filesystem>
#include <memory>
#include <string>

namespace grpc {
class ChannelCredentials;
}

namespace remesh::client {

/// How to know whom we talk to, and to show who we are.
struct Credentials {
    bool tls = false;              ///< Speak TLS; any of the files below says so, too.
    std::filesystem::path ca{};    ///< PEM authorities of the server; empty: the system's.
    std::filesystem::path cert{};  ///< PEM certificate chain of our own.
    std::filesystem::path key{};   ///< PEM private key of `cert`.
    std::filesystem::path token_file{};
    std::string token{};  ///< Instead of a file.

    [[nodiscard]] bool uses_tls() const { return tls || !ca.empty() || !cert.empty(); }
};

/// What a channel to `server` needs.
/// \throws Failure{Usage} if a file can't be read
[[nodiscard]] std::shared_ptr<grpc::ChannelCredentials> channel_credentials(
    const Credentials& credentials);

/// The token, or nothing.
/// \throws Failure{Usage} if its file can't be read or holds no token, or if it would be sent to
/// another machine without TLS
[[nodiscard]] std::string token_for(const std::string& server, const Credentials& credentials);

}  // namespace remesh::client
