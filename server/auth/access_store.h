#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/auth/principal.h"
#include "server/store/job_store.h"
#include "server/store/sqlite.h"

namespace remesh {

/// One right to call: a bearer token or a name in client certificates.
struct Credential {
    enum class Kind { Token, Certificate };

    std::string id{};  ///< Public; what `revoke` takes and the audit log shows.
    Kind kind = Kind::Token;
    std::string certificate_name{};  ///< Of a certificate; empty for a token.
    std::string tenant{};
    Role role = Role::User;
    std::string note{};  ///< The operator's own words.
    Time create_time{};
    std::optional<Time> expire_time{};
    std::optional<Time> revoke_time{};
};

/// What the operator says about a new credential.
struct CredentialRequest {
    std::string tenant{};
    Role role = Role::User;
    std::string note{};
    std::optional<Time> expire_time{};
};

struct IssuedToken {
    Credential credential{};
    std::string token{};  ///< Shown once: the store keeps its hash only.
};

/// The credentials of a data directory. Changes by one process hold in all others at once.
/// All calls may come from any thread.
///
/// A token is 256 random bits, so one SHA-256 is all the protection that its hash needs: there is
/// nothing to guess.
class AccessStore {
public:
    explicit AccessStore(const std::filesystem::path& data_dir);

    /// \throws std::invalid_argument if the tenant's name can't be one
    IssuedToken create_token(const CredentialRequest& request, Time now);
    /// Lets in client certificates that a trusted authority issued for `name`: one of their subject
    /// alternative names or, without any, their common name.
    /// \throws std::invalid_argument also if the name is let in already
    Credential allow_certificate(const std::string& name, const CredentialRequest& request,
                                 Time now);
    [[nodiscard]] std::vector<Credential> list();
    /// \return the credential, or nothing if there is no valid one of that id
    std::optional<Credential> revoke(const std::string& id, Time now);

    // What is valid now.

    [[nodiscard]] std::optional<Credential> find_token(std::string_view token, Time now);
    [[nodiscard]] std::optional<Credential> find_certificate(std::span<const std::string> names,
                                                             Time now);
    [[nodiscard]] bool is_valid(const std::string& id, Time now);

    /// The data directory's key for a purpose, 256 random bits in hexadecimal; made when it is
    /// asked for first.
    [[nodiscard]] std::string key_for(std::string_view purpose);

private:
    Credential insert(Credential credential, const std::string& proof);
    std::optional<Credential> find_proof(std::string_view kind, std::string_view proof, Time now);

    std::mutex mutex_;
    sqlite::Connection connection_;  // needs mutex_
};

}  // namespace remesh
