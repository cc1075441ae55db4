#pragma once

#include <openssl/ssl.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <mutex>
#include <utility>

namespace remesh::http {

/// A certificate and its key, read again when their files change: a certificate that was renewed is
/// served without a restart, and connections that are open stay. While the new files don't fit
/// together, as between two copies, the old ones are served.
class Certificates {
public:
    /// \param certificate  PEM chain
    /// \param key          PEM private key of its first certificate
    /// \param refresh      how often the files are looked at, at most
    /// \throws std::runtime_error if they can't be used
    Certificates(std::filesystem::path certificate, std::filesystem::path key,
                 std::chrono::milliseconds refresh = std::chrono::seconds(10));
    Certificates(const Certificates&) = delete;
    Certificates& operator=(const Certificates&) = delete;
    ~Certificates() = default;

    /// Lets every handshake of `context` take the newest; has to outlive it.
    void serve(SSL_CTX* context);

private:
    struct FreeContext {
        void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
    };
    using Context = std::unique_ptr<SSL_CTX, FreeContext>;
    using Clock = std::chrono::steady_clock;
    using Stamps = std::pair<std::filesystem::file_time_type, std::filesystem::file_time_type>;

    static int choose(SSL* connection, void* self);
    [[nodiscard]] Context read() const;
    [[nodiscard]] Stamps stamps() const;
    void look();

    const std::filesystem::path certificate_;
    const std::filesystem::path key_;
    const std::chrono::milliseconds refresh_;
    std::mutex mutex_;
    Context newest_;               // needs mutex_
    Stamps seen_;                  // needs mutex_
    Clock::time_point looked_at_;  // needs mutex_
};

}  // namespace remesh::http
