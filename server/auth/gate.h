#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/auth/access_store.h"
#include "server/auth/audit_log.h"
#include "server/auth/principal.h"

namespace remesh {

/// What a caller shows.
struct Papers {
    std::optional<std::string> authorization{};    ///< The header, "Bearer TOKEN".
    std::vector<std::string> certificate_names{};  ///< Of a verified client certificate.
    std::string peer{};                            ///< Where the call comes from.
};

/// Lets callers in and writes down what they do. The one place where a credential becomes a tenant.
/// All calls may come from any thread.
class Gate {
public:
    using Clock = std::function<Time()>;

    /// Strangers whom `require_acquaintance` lets pass at once; then, one a minute.
    static constexpr int kStrangers = 64;

    /// \param requires_credentials  false: a caller without any is the default tenant's operator
    Gate(const std::filesystem::path& data_dir, bool requires_credentials, Clock clock = {});

    /// \throws AccessError if the papers aren't valid or don't allow what `least` may do
    [[nodiscard]] Principal admit(const Papers& papers, Role least, std::string_view action);
    /// Asked before it is known where a call comes from: lets pass who shows a valid credential,
    /// and few enough others that `admit` can write down where they are. The rest are counted.
    /// \throws AccessError{Unauthenticated}
    void require_acquaintance(const Papers& papers);
    /// Whether somebody who was let in would still be.
    [[nodiscard]] bool is_still_valid(const Principal& who);

    /// \copydoc AccessStore::key_for
    [[nodiscard]] std::string key_for(std::string_view purpose) { return access_.key_for(purpose); }

    /// Writes down what was done. \throws StoreError if it can't be
    void record(const Principal& who, const std::string& peer, std::string_view action,
                const std::string& subject, const std::string& outcome);

private:
    [[nodiscard]] std::optional<Credential> credential_of(const Papers& papers, Time now);
    void note_refusal(const Papers& papers, std::string_view action, const std::string& outcome,
                      const Principal& who);

    AccessStore access_;
    AuditLog audit_;
    const bool requires_credentials_;
    const Clock clock_;

    std::mutex mutex_;
    std::optional<Time> last_refusal_{};   // needs mutex_; the last one that was written down
    std::int64_t unwritten_refusals_ = 0;  // needs mutex_
    Time strangers_until_{};               // needs mutex_; what those who passed have used up
};

}  // namespace remesh
