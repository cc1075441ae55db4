#include "server/store/sqlite_schema.h"

#include <array>
#include <string>

#include "server/store/job_store.h"

namespace remesh::sqlite {
namespace {

// Times are microseconds since 1970, UTC. The checks tie them to the states. Columns of a primary
// key come first: SQLite 3.40's integrity_check reports others as NULL in tables without rowid.
constexpr const char* kVersion1 = R"sql(
CREATE TABLE jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant TEXT NOT NULL,
    id TEXT NOT NULL,
    request_id TEXT,
    spec BLOB NOT NULL,
    priority INTEGER NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'cancelling', 'succeeded', 'failed',
                                         'cancelled', 'quarantined')),
    attempt INTEGER NOT NULL CHECK (attempt >= 0),
    max_attempts INTEGER NOT NULL CHECK (max_attempts >= 1),
    epoch INTEGER NOT NULL,
    revision INTEGER NOT NULL,
    create_time INTEGER NOT NULL,
    start_time INTEGER,
    end_time INTEGER,
    outcome BLOB NOT NULL,
    last_sequence INTEGER NOT NULL,
    UNIQUE (tenant, id),
    UNIQUE (tenant, request_id),
    CHECK ((state IN ('succeeded', 'failed', 'cancelled', 'quarantined'))
           = (end_time IS NOT NULL)),
    CHECK (state NOT IN ('running', 'cancelling', 'succeeded', 'failed', 'quarantined')
           OR start_time IS NOT NULL)
) STRICT;
CREATE INDEX jobs_by_queue ON jobs (priority DESC, number) WHERE state = 'queued';
CREATE INDEX jobs_by_tenant ON jobs (tenant, number);

CREATE TABLE events (
    job INTEGER NOT NULL REFERENCES jobs (number) ON DELETE CASCADE,
    sequence INTEGER NOT NULL CHECK (sequence >= 1),
    time INTEGER NOT NULL,
    kind INTEGER NOT NULL,
    payload BLOB NOT NULL,
    state TEXT,
    attempt INTEGER,
    PRIMARY KEY (job, sequence)
) STRICT, WITHOUT ROWID;

CREATE TABLE artifacts (
    tenant TEXT NOT NULL,
    sha256 TEXT NOT NULL CHECK (length(sha256) = 64),
    size INTEGER NOT NULL CHECK (size >= 0),
    create_time INTEGER NOT NULL,
    PRIMARY KEY (tenant, sha256)
) STRICT, WITHOUT ROWID;

CREATE TABLE job_artifacts (
    job INTEGER NOT NULL REFERENCES jobs (number) ON DELETE CASCADE,
    role TEXT NOT NULL CHECK (role IN ('input', 'output', 'preview')),
    sha256 TEXT NOT NULL,
    tenant TEXT NOT NULL,
    PRIMARY KEY (job, role, sha256),
    FOREIGN KEY (tenant, sha256) REFERENCES artifacts (tenant, sha256)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_artifacts_by_artifact ON job_artifacts (tenant, sha256);
)sql";

constexpr std::array kSteps{kVersion1};

}  // namespace

void migrate(Connection& connection) {
    const auto version = [&] {
        Statement pragma(connection, "PRAGMA user_version");
        pragma.next();
        return static_cast<std::size_t>(pragma.integer(0));
    }();
    if (version > kSteps.size()) {
        throw StoreError("store: written by a newer version of remeshd (schema " +
                         std::to_string(version) + ", this one knows " +
                         std::to_string(kSteps.size()) + ")");
    }
    for (std::size_t step = version; step < kSteps.size(); ++step) {
        Transaction transaction(connection);
        connection.execute(kSteps[step]);
        connection.execute(("PRAGMA user_version = " + std::to_string(step + 1)).c_str());
        transaction.commit();
    }
}

}  // namespace remesh::sqlite
