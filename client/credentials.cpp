#include "client/credentials.h"

#include <fmt/format.h>
#include <grpcpp/security/credentials.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "client/failure.h"
#include "client/text.h"

namespace remesh::client {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSystemAuthorities = "/etc/ssl/certs/ca-certificates.crt";
constexpr std::size_t kLongestToken = 4096;

std::string read(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    std::string content{std::istreambuf_iterator<char>(stream), {}};
    if (!stream && content.empty()) {
        const Failure reason = system_failure(fmt::format("can't read {}", file.string()));
        throw Failure(ExitCode::Usage, reason.what());
    }
    return content;
}

fs::path authorities(const Credentials& credentials) {
    if (!credentials.ca.empty()) {
        return credentials.ca;
    }
    const char* named = std::getenv("SSL_CERT_FILE");
    return named != nullptr ? named : kSystemAuthorities;
}

/// Whether what goes there stays on this machine.
bool is_local(const std::string& server) {
    return server.starts_with("unix:") || server.starts_with("127.") ||
           server.starts_with("localhost:") || server.starts_with("[::1]:");
}

}  // namespace

std::shared_ptr<grpc::ChannelCredentials> channel_credentials(const Credentials& credentials) {
    if (!credentials.uses_tls()) {
        return grpc::InsecureChannelCredentials();
    }
    if (credentials.cert.empty() != credentials.key.empty()) {
        throw Failure(ExitCode::Usage, "--tls-cert and --tls-key belong together");
    }
    grpc::SslCredentialsOptions tls;
    tls.pem_root_certs = read(authorities(credentials));
    if (!credentials.cert.empty()) {
        tls.pem_cert_chain = read(credentials.cert);
        tls.pem_private_key = read(credentials.key);
    }
    return grpc::SslCredentials(tls);
}

std::string token_for(const std::string& server, const Credentials& credentials) {
    std::string token = credentials.token;
    if (token.empty() && !credentials.token_file.empty()) {
        token = read(credentials.token_file);
    }
    token.erase(token.find_last_not_of(" \t\r\n") + 1);
    if (token.empty()) {
        if (!credentials.token_file.empty()) {
            throw Failure(ExitCode::Usage,
                          fmt::format("{} holds no token", credentials.token_file.string()));
        }
        return token;
    }
    const bool is_plain =
        std::all_of(token.begin(), token.end(), [](char c) { return c > ' ' && c <= '~'; });
    if (!is_plain || token.size() > kLongestToken) {
        throw Failure(ExitCode::Usage, "a token is one word of printable characters");
    }
    if (!credentials.uses_tls() && !is_local(server)) {
        throw Failure(ExitCode::Usage,
                      fmt::format("a token isn't sent to {} without TLS: say --tls-ca FILE, or "
                                  "--tls for the system's authorities",
                                  sanitised(server)));
    }
    return token;
}

}  // namespace remesh::client
