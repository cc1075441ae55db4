#pragma once

#include <grpcpp/security/server_credentials.h>

#include <chrono>
#include <filesystem>
#include <memory>

namespace remesh {

/// The files of a server that speaks TLS. All PEM, re-read when they change.
struct TlsOptions {
    std::filesystem::path certificate{};  ///< Its chain, own certificate first; empty: no TLS.
    std::filesystem::path key{};          ///< Private key of the certificate.
    std::filesystem::path client_ca{};    ///< Authorities that client certificates may come from;
                                          ///< empty: none are asked for.
    std::chrono::seconds refresh{10};     ///< How often the files are looked at, >= 1.

    [[nodiscard]] bool is_on() const { return !certificate.empty(); }
};

/// When the first certificate of a PEM file ends.
/// \throws std::runtime_error that names the file if it can't be read or isn't PEM
[[nodiscard]] std::chrono::sys_seconds certificate_end(const std::filesystem::path& certificate);

/// What a server listens with. Clients may show a certificate, if there is a client authority, but
/// needn't: whether they have to show anything is the Gate's matter.
///
/// \throws std::runtime_error that names the file if one can't be read, isn't PEM, or if the key
/// isn't that of the certificate. One that has ended, or will within a week, is warned of: it may
/// be renewed while the server runs.
[[nodiscard]] std::shared_ptr<grpc::ServerCredentials> server_credentials(
    const TlsOptions& options);

}  // namespace remesh
