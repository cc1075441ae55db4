#include "server/auth/access_database.h"

#include <sys/stat.h>

#include <string>

#include "server/store/job_store.h"

namespace remesh {
namespace {

constexpr std::int64_t kVersion = 1;

// Times are microseconds since 1970, UTC. A credential is never deleted: the audit log names it.
constexpr const char* kSchema = R"sql(
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

}  // namespace

sqlite::Connection open_access_database(const std::filesystem::path& data_dir) {
    const auto file = data_dir / "access.sqlite";
    const auto mask = ::umask(0077);
    sqlite::Connection connection(file.string(), sqlite::Connection::Mode::ReadWrite);
    connection.execute("PRAGMA journal_mode = WAL");
    ::umask(mask);
    connection.execute("PRAGMA synchronous = FULL");

    sqlite::Transaction transaction(connection);
    const auto version = [&] {
        sqlite::Statement row(connection, "PRAGMA user_version");
        row.next();
        return row.integer(0);
    }();
    if (version > kVersion) {
        throw StoreError("store: access.sqlite was written by a newer version of remeshd");
    }
    if (version == 0) {
        connection.execute(kSchema);
        connection.execute("PRAGMA user_version = 1");
    }
    transaction.commit();
    return connection;
}

}  // namespace remesh
