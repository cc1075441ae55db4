#include "server/tls.h"

#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <spdlog/spdlog.h>

#include <cstdio>
#include <ctime>
#include <stdexcept>
#include <string>

namespace remesh {
namespace {

constexpr std::chrono::days kWarnBefore{7};

template <auto Free>
struct FreeWith {
    template <typename T>
    void operator()(T* object) const {
        Free(object);
    }
};
using File = std::unique_ptr<std::FILE, FreeWith<std::fclose>>;
using Certificate = std::unique_ptr<X509, FreeWith<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, FreeWith<EVP_PKEY_free>>;

File open(const std::filesystem::path& path) {
    File file(std::fopen(path.c_str(), "re"));
    if (!file) {
        throw std::runtime_error("can't read " + path.string());
    }
    return file;
}

Certificate read_certificate(const std::filesystem::path& path) {
    Certificate certificate(PEM_read_X509(open(path).get(), nullptr, nullptr, nullptr));
    if (!certificate) {
        throw std::runtime_error(path.string() + " holds no PEM certificate");
    }
    return certificate;
}

std::chrono::sys_seconds end_of(const Certificate& certificate) {
    std::tm end{};
    if (ASN1_TIME_to_tm(X509_get0_notAfter(certificate.get()), &end) != 1) {
        return {};
    }
    return std::chrono::sys_seconds(std::chrono::seconds(::timegm(&end)));
}

/// Once it has ended, no client takes it.
void warn_of_end(std::chrono::sys_seconds end, const std::filesystem::path& file) {
    // In seconds: a certificate without an end says the year 9999, too far for nanoseconds.
    const auto left =
        end - std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
    if (left <= std::chrono::seconds(0)) {
        spdlog::warn("event=certificate_expired file={}", file.string());
    } else if (left < kWarnBefore) {
        spdlog::warn("event=certificate_expires_soon file={} hours={}", file.string(),
                     std::chrono::duration_cast<std::chrono::hours>(left).count());
    }
}

/// gRPC would only log trouble with the files and then fail every handshake.
void require_usable(const TlsOptions& options) {
    const Certificate certificate = read_certificate(options.certificate);
    const Key key(PEM_read_PrivateKey(open(options.key).get(), nullptr, nullptr, nullptr));
    if (!key) {
        throw std::runtime_error(options.key.string() + " holds no PEM private key");
    }
    if (X509_check_private_key(certificate.get(), key.get()) != 1) {
        throw std::runtime_error(options.key.string() + " isn't the key of the certificate in " +
                                 options.certificate.string());
    }
    warn_of_end(end_of(certificate), options.certificate);
    if (!options.client_ca.empty()) {
        static_cast<void>(read_certificate(options.client_ca));
    }
}

}  // namespace

std::chrono::sys_seconds certificate_end(const std::filesystem::path& certificate) {
    return end_of(read_certificate(certificate));
}

std::shared_ptr<grpc::ServerCredentials> server_credentials(const TlsOptions& options) {
    if (!options.is_on()) {
        return grpc::InsecureServerCredentials();
    }
    require_usable(options);
    const bool asks_clients = !options.client_ca.empty();
    const auto refresh = static_cast<unsigned int>(options.refresh.count());
    using grpc::experimental::FileWatcherCertificateProvider;
    const auto files = asks_clients
                           ? std::make_shared<FileWatcherCertificateProvider>(
                                 options.key, options.certificate, options.client_ca, refresh)
                           : std::make_shared<FileWatcherCertificateProvider>(
                                 options.key, options.certificate, refresh);
    grpc::experimental::TlsServerCredentialsOptions tls(files);
    tls.watch_identity_key_cert_pairs();
    if (asks_clients) {
        tls.watch_root_certs();
        tls.set_cert_request_type(GRPC_SSL_REQUEST_CLIENT_CERTIFICATE_AND_VERIFY);
    }
    return grpc::experimental::TlsServerCredentials(tls);
}

}  // namespace remesh
