#pragma once

#include <compare>
#include <stdexcept>
#include <string>
#include <string_view>

namespace remesh {

/// The only tenant there is without authentication.
inline constexpr std::string_view kDefaultTenant = "default";

/// What a credential allows; each includes those before it.
enum class Role {
    Viewer,    ///< Reads jobs and artifacts of its tenant.
    User,      ///< Makes, cancels and deletes them, too.
    Operator,  ///< Reads what all tenants add up to, too (metrics, SummarizeQueue); never
               ///< another tenant's jobs.
};

/// Whose call it is.
struct Principal {
    std::string tenant{};
    Role role = Role::Viewer;
    std::string credential{};  ///< Id of the credential; empty if none was asked for.
    /// "token:ID", "certificate:ID" or "anonymous": who did it, for the audit log.
    [[nodiscard]] std::string actor() const;
    bool is_certificate = false;
};

enum class AccessErrorCode {
    Unauthenticated,  ///< No credential, or none that is valid.
    Denied,           ///< A valid one that doesn't allow it.
};

/// Why a caller isn't let in. Says the same whatever was wrong with a credential.
class AccessError : public std::runtime_error {
public:
    AccessError(AccessErrorCode code, const std::string& message)
        : std::runtime_error(message), code_(code) {}
    [[nodiscard]] AccessErrorCode code() const noexcept { return code_; }

private:
    AccessErrorCode code_;
};

/// Tenants and jobs are named by 1 to 64 lower-case letters, digits and hyphens.
[[nodiscard]] bool is_name(std::string_view text);

[[nodiscard]] std::string_view role_name(Role role);
/// \throws std::invalid_argument naming the roles there are
[[nodiscard]] Role role_named(std::string_view name);

}  // namespace remesh
