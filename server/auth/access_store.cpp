#include "server/auth/access_store.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "server/auth/access_database.h"
#include "server/store/digest.h"

namespace remesh {
namespace {

// Lets scanners for leaked secrets know it.
constexpr std::string_view kTokenPrefix = "remesh_";
constexpr int kTokenBytes = 32;
constexpr int kKeyBytes = 32;
constexpr int kIdBytes = 6;
constexpr std::size_t kMaxText = 200;

std::int64_t to_row(Time time) {
    return time.time_since_epoch().count();
}

std::optional<std::int64_t> to_row(const std::optional<Time>& time) {
    return time ? std::optional(to_row(*time)) : std::nullopt;
}

std::optional<Time> to_time(const std::optional<std::int64_t>& row) {
    return row ? std::optional(Time(std::chrono::microseconds(*row))) : std::nullopt;
}

std::string_view kind_name(Credential::Kind kind) {
    return kind == Credential::Kind::Token ? "token" : "certificate";
}

constexpr std::string_view kColumns =
    "id, kind, proof, tenant, role, note, create_time, expire_time, revoke_time";

Credential credential_of(const sqlite::Statement& row) {
    Credential credential;
    credential.id = row.text(0);
    if (row.text(1) == "certificate") {
        credential.kind = Credential::Kind::Certificate;
        credential.certificate_name = row.text(2);
    }
    credential.tenant = row.text(3);
    credential.role = role_named(row.text(4));
    credential.note = row.text(5);
    credential.create_time = Time(std::chrono::microseconds(row.integer(6)));
    credential.expire_time = to_time(row.maybe_integer(7));
    credential.revoke_time = to_time(row.maybe_integer(8));
    return credential;
}

std::string select(std::string_view rest) {
    return std::string("SELECT ").append(kColumns).append(" FROM credentials ").append(rest);
}

Credential new_credential(Credential::Kind kind, const CredentialRequest& request, Time now) {
    if (!is_name(request.tenant)) {
        throw std::invalid_argument(
            "a tenant's name must have 1 to 64 lower-case letters, digits and hyphens, got \"" +
            request.tenant + "\"");
    }
    if (request.note.size() > kMaxText) {
        throw std::invalid_argument("a note must have at most 200 bytes, got " +
                                    std::to_string(request.note.size()));
    }
    Credential credential;
    credential.id = random_hex(kIdBytes);
    credential.kind = kind;
    credential.tenant = request.tenant;
    credential.role = request.role;
    credential.note = request.note;
    credential.create_time = now;
    credential.expire_time = request.expire_time;
    return credential;
}

}  // namespace

AccessStore::AccessStore(const std::filesystem::path& data_dir)
    : connection_(open_access_database(data_dir)) {}

IssuedToken AccessStore::create_token(const CredentialRequest& request, Time now) {
    std::string token = std::string(kTokenPrefix) + random_hex(kTokenBytes);
    return {insert(new_credential(Credential::Kind::Token, request, now), sha256_of(token)), token};
}

Credential AccessStore::allow_certificate(const std::string& name, const CredentialRequest& request,
                                          Time now) {
    if (name.empty() || name.size() > kMaxText) {
        throw std::invalid_argument("a certificate's name must have 1 to 200 bytes, got " +
                                    std::to_string(name.size()));
    }
    if (find_proof("certificate", name, now)) {
        throw std::invalid_argument("certificates for " + name + " are let in already");
    }
    Credential credential = new_credential(Credential::Kind::Certificate, request, now);
    credential.certificate_name = name;
    return insert(std::move(credential), name);
}

Credential AccessStore::insert(Credential credential, const std::string& proof) {
    const std::scoped_lock lock(mutex_);
    sqlite::Statement statement(connection_,
                                std::string("INSERT INTO credentials (").append(kColumns) +
                                    ") VALUES (?, ?, ?, ?, ?, ?, ?, ?, NULL)");
    statement.bind(credential.id)
        .bind(kind_name(credential.kind))
        .bind(proof)
        .bind(credential.tenant)
        .bind(role_name(credential.role))
        .bind(credential.note)
        .bind(to_row(credential.create_time))
        .bind(to_row(credential.expire_time));
    statement.run();
    return credential;
}

std::vector<Credential> AccessStore::list() {
    const std::scoped_lock lock(mutex_);
    sqlite::Statement row(connection_, select("ORDER BY create_time, id"));
    std::vector<Credential> credentials;
    while (row.next()) {
        credentials.push_back(credential_of(row));
    }
    return credentials;
}

std::optional<Credential> AccessStore::revoke(const std::string& id, Time now) {
    const std::scoped_lock lock(mutex_);
    sqlite::Transaction transaction(connection_);
    std::optional<Credential> credential;
    {
        sqlite::Statement row(connection_, select("WHERE id = ? AND revoke_time IS NULL"));
        row.bind(id);
        if (row.next()) {
            credential = credential_of(row);
        }
    }
    if (credential) {
        sqlite::Statement statement(connection_,
                                    "UPDATE credentials SET revoke_time = ? WHERE id = ?");
        statement.bind(to_row(now)).bind(id);
        statement.run();
        credential->revoke_time = now;
    }
    transaction.commit();
    return credential;
}

std::optional<Credential> AccessStore::find_proof(std::string_view kind, std::string_view proof,
                                                  Time now) {
    const std::scoped_lock lock(mutex_);
    sqlite::Statement row(connection_,
                          select("WHERE kind = ? AND proof = ? AND revoke_time IS NULL "
                                 "AND (expire_time IS NULL OR expire_time > ?)"));
    row.bind(kind).bind(proof).bind(to_row(now));
    return row.next() ? std::optional(credential_of(row)) : std::nullopt;
}

std::optional<Credential> AccessStore::find_token(std::string_view token, Time now) {
    return find_proof("token", sha256_of(token), now);
}

std::optional<Credential> AccessStore::find_certificate(std::span<const std::string> names,
                                                        Time now) {
    for (const std::string& name : names) {
        if (auto credential = find_proof("certificate", name, now)) {
            return credential;
        }
    }
    return std::nullopt;
}

bool AccessStore::is_valid(const std::string& id, Time now) {
    const std::scoped_lock lock(mutex_);
    sqlite::Statement row(connection_,
                          "SELECT 1 FROM credentials WHERE id = ? AND revoke_time IS NULL "
                          "AND (expire_time IS NULL OR expire_time > ?)");
    row.bind(id).bind(to_row(now));
    return row.next();
}

std::string AccessStore::key_for(std::string_view purpose) {
    const std::scoped_lock lock(mutex_);
    const std::string fresh = random_hex(kKeyBytes);
    sqlite::Statement insert(connection_,
                             "INSERT OR IGNORE INTO keys (purpose, key) VALUES (?, ?)");
    insert.bind(purpose).bind(fresh);
    insert.run();
    sqlite::Statement row(connection_, "SELECT key FROM keys WHERE purpose = ?");
    row.bind(purpose);
    row.next();
    return row.text(0);
}

}  // namespace remesh
