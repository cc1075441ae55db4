#include "server/store/sqlite_schema.h"

#include <array>
#include <string>

#include "server/store/job_record.h"

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

// Several processes share the store: leases name their worker, and a number that grows over all
// events (id) tells each process what the others wrote. Tenants share the workers by weight.
constexpr const char* kVersion2 = R"sql(
CREATE TABLE new_jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant TEXT NOT NULL,
    id TEXT NOT NULL,
    request_id TEXT,
    spec BLOB NOT NULL,
    priority INTEGER NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'cancelling', 'succeeded', 'failed',
                                         'cancelled', 'quarantined')),
    attempt INTEGER NOT NULL CHECK (attempt BETWEEN 0 AND max_attempts),
    max_attempts INTEGER NOT NULL CHECK (max_attempts >= 1),
    crashes INTEGER NOT NULL CHECK (crashes BETWEEN 0 AND attempt),
    epoch INTEGER NOT NULL CHECK (epoch >= attempt),
    worker TEXT,
    beat INTEGER NOT NULL,
    revision INTEGER NOT NULL,
    create_time INTEGER NOT NULL,
    start_time INTEGER CHECK (start_time >= create_time),
    end_time INTEGER CHECK (end_time >= create_time),
    retry_time INTEGER,
    outcome BLOB NOT NULL,
    cache_key TEXT,
    origin TEXT,
    UNIQUE (tenant, id),
    UNIQUE (tenant, request_id),
    CHECK ((state IN ('running', 'cancelling')) = (worker IS NOT NULL)),
    CHECK ((state IN ('succeeded', 'failed', 'cancelled', 'quarantined'))
           = (end_time IS NOT NULL)),
    CHECK (state IN ('queued', 'cancelled') OR start_time IS NOT NULL),
    CHECK (start_time IS NULL OR end_time IS NULL OR end_time >= start_time),
    CHECK (state = 'queued' OR retry_time IS NULL),
    CHECK (state IN ('succeeded', 'failed', 'quarantined') OR length(outcome) = 0)
) STRICT;
INSERT INTO new_jobs
    SELECT number, tenant, id, request_id, spec, priority, state, min(attempt, max_attempts),
           max_attempts, 0, max(epoch, attempt),
           CASE WHEN state IN ('running', 'cancelling') THEN 'before-version-2' END, 0, revision,
           create_time, max(start_time, create_time),
           max(end_time, create_time, coalesce(start_time, create_time)), NULL, outcome, NULL, NULL
    FROM jobs ORDER BY number;

CREATE TABLE new_events (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    job INTEGER NOT NULL REFERENCES jobs (number) ON DELETE CASCADE,
    sequence INTEGER NOT NULL CHECK (sequence >= 1),
    time INTEGER NOT NULL,
    kind INTEGER NOT NULL CHECK (kind BETWEEN 0 AND 4),
    payload BLOB NOT NULL,
    state TEXT,
    attempt INTEGER,
    UNIQUE (job, sequence),
    CHECK ((kind = 0) = (state IS NOT NULL AND attempt IS NOT NULL))
) STRICT;
INSERT INTO new_events
    SELECT NULL, job, sequence, time, kind, payload, state, attempt
    FROM events ORDER BY job, sequence;

DROP TABLE events;
DROP TABLE jobs;
ALTER TABLE new_jobs RENAME TO jobs;
ALTER TABLE new_events RENAME TO events;
CREATE INDEX jobs_by_queue ON jobs (tenant, priority DESC, number) WHERE state = 'queued';
CREATE INDEX jobs_by_tenant ON jobs (tenant, number);
CREATE INDEX jobs_held ON jobs (tenant) WHERE state IN ('running', 'cancelling');
CREATE INDEX jobs_by_end ON jobs (end_time) WHERE end_time IS NOT NULL;
CREATE INDEX jobs_by_result ON jobs (tenant, cache_key, number)
    WHERE state = 'succeeded' AND cache_key IS NOT NULL;

CREATE TABLE tenants (
    name TEXT PRIMARY KEY,
    weight INTEGER NOT NULL CHECK (weight BETWEEN 1 AND 1000),
    max_running INTEGER CHECK (max_running >= 0),
    max_queued INTEGER CHECK (max_queued >= 0),
    max_bytes INTEGER CHECK (max_bytes >= 0),
    used INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE queue_level (one INTEGER PRIMARY KEY CHECK (one = 1), used INTEGER NOT NULL) STRICT;
INSERT INTO queue_level VALUES (1, 0);
)sql";

// How long a tenant's last jobs took is asked whenever one that waits is shown.
constexpr const char* kVersion3 = R"sql(
CREATE INDEX jobs_by_success ON jobs (tenant, end_time, number, start_time)
    WHERE state = 'succeeded' AND attempt > 0;
)sql";

constexpr std::array kSteps{kVersion1, kVersion2, kVersion3};

// "RMSH"
constexpr std::int64_t kApplicationId = 0x524d5348;

}  // namespace

void require_own(Connection& connection) {
    const std::int64_t version = connection.integer("PRAGMA user_version");
    if (version == 0 && connection.integer("SELECT COUNT(*) FROM sqlite_schema") > 0) {
        throw StoreError("store: the file is a database of another program");
    }
    if (version > static_cast<std::int64_t>(kSteps.size())) {
        throw StoreError("store: written by a newer version of remeshd (schema " +
                         std::to_string(version) + ", this one knows " +
                         std::to_string(kSteps.size()) + ")");
    }
}

void migrate(Connection& connection) {
    // Tables are rebuilt, which foreign keys would take for deletions.
    connection.execute("PRAGMA foreign_keys = OFF");
    Transaction transaction(connection);  // one process migrates, others wait here
    require_own(connection);
    const auto version = static_cast<std::size_t>(connection.integer("PRAGMA user_version"));
    for (std::size_t step = version; step < kSteps.size(); ++step) {
        connection.execute(kSteps[step]);
    }
    if (version < kSteps.size()) {
        connection.execute(("PRAGMA user_version = " + std::to_string(kSteps.size())).c_str());
        connection.execute(("PRAGMA application_id = " + std::to_string(kApplicationId)).c_str());
    }
    transaction.commit();
}

}  // namespace remesh::sqlite
