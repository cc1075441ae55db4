#include "server/auth/access_database.h"

#include <sys/stat.h>

#include <array>
#include <string>

#include "server/store/job_store.h"

namespace remesh {
namespace {

// Times are microseconds since 1970, UTC. A credential is never deleted: the audit log names it.
constexpr const char* kVersion1 = R"sql(
CREATE TABLE credentials (
    id TEXT PRIMARY KEY,
    kind TEXT NOT NULL CHECK (kind IN ('token', 'certificate')),
    proof TEXT NOT NULL,
    tenant TEXT NOT NULL,
    role TEXT NOT NULL CHECK (role IN ('viewer', 'user', 'operator')),
    note TEXT NOT NULL,
    create_time INTEGER NOT NULL,
    expire_time INTEGER,
    revoke_time INTEGER
) STRICT;
CREATE UNIQUE INDEX credentials_by_proof ON credentials (kind, proof) WHERE revoke_time IS NULL;

CREATE TABLE audit (
    sequence INTEGER PRIMARY KEY,
    time INTEGER NOT NULL,
    tenant TEXT NOT NULL,
    actor TEXT NOT NULL,
    peer TEXT NOT NULL,
    action TEXT NOT NULL,
    subject TEXT NOT NULL,
    outcome TEXT NOT NULL,
    hash TEXT NOT NULL CHECK (length(hash) = 64)
) STRICT;
CREATE TRIGGER audit_keeps_rows BEFORE DELETE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit log only grows'); END;
CREATE TRIGGER audit_keeps_values BEFORE UPDATE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit log only grows'); END;
)sql";

// What the server seals things with that callers keep.
constexpr const char* kVersion2 = R"sql(
CREATE TABLE keys (
    purpose TEXT PRIMARY KEY,
    key TEXT NOT NULL CHECK (length(key) = 64)
) STRICT, WITHOUT ROWID;
)sql";

constexpr std::array kSteps{kVersion1, kVersion2};

}  // namespace

sqlite::Connection open_access_database(const std::filesystem::path& data_dir) {
    const auto file = data_dir / "access.sqlite";
    const auto mask = ::umask(0077);
    sqlite::Connection connection(file.string(), sqlite::Connection::Mode::ReadWrite);
    connection.execute("PRAGMA journal_mode = WAL");
    ::umask(mask);
    connection.execute("PRAGMA synchronous = FULL");

    sqlite::Transaction transaction(connection);
    const auto version = static_cast<std::size_t>(connection.integer("PRAGMA user_version"));
    if (version > kSteps.size()) {
        throw StoreError("store: access.sqlite was written by a newer version of remeshd");
    }
    for (std::size_t step = version; step < kSteps.size(); ++step) {
        connection.execute(kSteps[step]);
    }
    if (version < kSteps.size()) {
        connection.execute(("PRAGMA user_version = " + std::to_string(kSteps.size())).c_str());
    }
    transaction.commit();
    return connection;
}

}  // namespace remesh
