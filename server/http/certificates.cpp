#include "server/http/certificates.h"

#include <openssl/err.h>

#include <stdexcept>
#include <system_error>

namespace remesh::http {

Certificates::Certificates(std::filesystem::path certificate, std::filesystem::path key,
                           std::chrono::milliseconds refresh)
    : certificate_(std::move(certificate)),
      key_(std::move(key)),
      refresh_(refresh),
      newest_(read()),
      seen_(stamps()),
      looked_at_(Clock::now()) {
    if (!newest_) {
        throw std::runtime_error("can't use the TLS certificate " + certificate_.string() +
                                 " and its key for HTTP");
    }
}

void Certificates::serve(SSL_CTX* context) {
    SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
    SSL_CTX_set_cert_cb(context, &Certificates::choose, this);
}

int Certificates::choose(SSL* connection, void* self) {
    auto& certificates = *static_cast<Certificates*>(self);
    const std::scoped_lock lock(certificates.mutex_);
    certificates.look();
    // The connection keeps a reference of its own.
    return SSL_set_SSL_CTX(connection, certificates.newest_.get()) != nullptr ? 1 : 0;
}

Certificates::Context Certificates::read() const {
    Context context(SSL_CTX_new(TLS_server_method()));
    const bool is_usable =
        context && SSL_CTX_use_certificate_chain_file(context.get(), certificate_.c_str()) == 1 &&
        SSL_CTX_use_PrivateKey_file(context.get(), key_.c_str(), SSL_FILETYPE_PEM) == 1 &&
        SSL_CTX_check_private_key(context.get()) == 1;
    ERR_clear_error();
    return is_usable ? std::move(context) : nullptr;
}

Certificates::Stamps Certificates::stamps() const {
    std::error_code missing;
    return {std::filesystem::last_write_time(certificate_, missing),
            std::filesystem::last_write_time(key_, missing)};
}

void Certificates::look() {
    if (Clock::now() - looked_at_ < refresh_) {
        return;
    }
    looked_at_ = Clock::now();
    // Taken before the files are read: a change in between is seen the next time.
    const Stamps now = stamps();
    if (now == seen_) {
        return;
    }
    if (Context fresh = read()) {
        newest_ = std::move(fresh);
        seen_ = now;
    }
}

}  // namespace remesh::http
