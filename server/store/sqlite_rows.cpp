#include "server/store/sqlite_rows.h"

#include <algorithm>

namespace remesh::sqlite {
namespace {

std::optional<Time> to_time(const std::optional<std::int64_t>& row) {
    return row ? std::optional(sqlite::to_time(*row)) : std::nullopt;
}

std::optional<std::int64_t> to_row(const std::optional<Time>& time) {
    return time ? std::optional(sqlite::to_row(*time)) : std::nullopt;
}

void bind_text(Statement& statement, const std::string& text) {
    text.empty() ? statement.bind_null() : statement.bind(text);
}

void update(Connection& connection, const JobRecord& job) {
    Statement statement(connection,
                        "UPDATE jobs SET state = ?, attempt = ?, crashes = ?, epoch = ?, "
                        "worker = ?, beat = ?, revision = ?, start_time = ?, end_time = ?, "
                        "retry_time = ?, outcome = ? WHERE number = ?");
    statement.bind(state_name(job.state)).bind(job.attempt).bind(job.crashes).bind(job.epoch);
    bind_text(statement, job.worker);
    statement.bind(job.beat)
        .bind(job.revision)
        .bind(to_row(job.start_time))
        .bind(to_row(job.end_time))
        .bind(to_row(job.retry_time))
        .bind_blob(job.outcome)
        .bind(job.number);
    statement.run();
}

}  // namespace

JobState state_of(std::string_view name) {
    for (std::size_t i = 0; i < kStateNames.size(); ++i) {
        if (kStateNames[i] == name) {
            return static_cast<JobState>(i);
        }
    }
    throw StoreError("store: unknown job state in the database");
}

std::int64_t to_row(Time time) {
    return time.time_since_epoch().count();
}

Time to_time(std::int64_t row) {
    return Time(std::chrono::microseconds(row));
}

std::string select_jobs(std::string_view rest) {
    std::string sql =
        "SELECT tenant, id, number, spec, priority, state, attempt, max_attempts, crashes, epoch, "
        "worker, beat, revision, create_time, start_time, end_time, retry_time, outcome, origin, "
        "(SELECT COALESCE(MAX(sequence), 0) FROM events WHERE job = number) FROM jobs ";
    return sql.append(rest);
}

JobRecord job_of(const Statement& row) {
    JobRecord job;
    job.key = {row.text(0), row.text(1)};
    job.number = row.integer(2);
    job.spec = row.text(3);
    job.priority = static_cast<int>(row.integer(4));
    job.state = state_of(row.text(5));
    job.attempt = static_cast<int>(row.integer(6));
    job.max_attempts = static_cast<int>(row.integer(7));
    job.crashes = static_cast<int>(row.integer(8));
    job.epoch = row.integer(9);
    job.worker = row.text(10);
    job.beat = row.integer(11);
    job.revision = row.integer(12);
    job.create_time = to_time(row.integer(13));
    job.start_time = to_time(row.maybe_integer(14));
    job.end_time = to_time(row.maybe_integer(15));
    job.retry_time = to_time(row.maybe_integer(16));
    job.outcome = row.text(17);
    job.origin = row.text(18);
    job.last_sequence = row.integer(19);
    return job;
}

StoredEvent event_of(const Statement& row) {
    StoredEvent event{row.integer(0), static_cast<EventKind>(row.integer(1)),
                      to_time(row.integer(2)), row.text(3)};
    if (event.kind == EventKind::State) {
        event.state = state_of(row.text(4));
        event.attempt = static_cast<int>(row.integer(5));
    }
    return event;
}

std::optional<JobRecord> find_job(Connection& connection, const JobKey& key) {
    Statement row(connection, select_jobs("WHERE tenant = ? AND id = ?"));
    row.bind(key.tenant).bind(key.id);
    return row.next() ? std::optional(job_of(row)) : std::nullopt;
}

std::optional<JobRecord> find_claimed(Connection& connection, const Claim& claim) {
    auto job = find_job(connection, claim.key);
    return job && job->epoch == claim.epoch && is_held(job->state) ? job : std::nullopt;
}

std::optional<ArtifactId> find_artifact(Connection& connection, const std::string& tenant,
                                        const std::string& sha256) {
    Statement row(connection, "SELECT size FROM artifacts WHERE tenant = ? AND sha256 = ?");
    row.bind(tenant).bind(sha256);
    return row.next() ? std::optional(ArtifactId{sha256, row.integer(0)}) : std::nullopt;
}

TenantPolicy find_policy(Connection& connection, const std::string& tenant) {
    Statement row(connection,
                  "SELECT weight, max_running, max_queued, max_bytes FROM tenants WHERE name = ?");
    row.bind(tenant);
    return row.next() ? TenantPolicy{static_cast<int>(row.integer(0)), row.maybe_integer(1),
                                     row.maybe_integer(2), row.maybe_integer(3)}
                      : TenantPolicy{};
}

std::int64_t stored_bytes(Connection& connection, const std::string& tenant) {
    Statement row(connection, "SELECT COALESCE(SUM(size), 0) FROM artifacts WHERE tenant = ?");
    row.bind(tenant);
    row.next();
    return row.integer(0);
}

void insert_job(Connection& connection, const NewJob& job, Time now) {
    Statement statement(
        connection,
        "INSERT INTO jobs (tenant, id, request_id, spec, priority, state, attempt, max_attempts, "
        "crashes, epoch, beat, revision, create_time, outcome, cache_key, origin) "
        "VALUES (?, ?, ?, ?, ?, 'queued', 0, ?, 0, 0, 0, 0, ?, x'', ?, ?)");
    statement.bind(job.key.tenant).bind(job.key.id);
    bind_text(statement, job.request_id);
    statement.bind_blob(job.spec).bind(job.priority).bind(job.max_attempts).bind(to_row(now));
    bind_text(statement, job.cache_key);
    bind_text(statement, job.origin);
    statement.run();
}

void enter(Connection& connection, JobRecord& job, JobState state, Time now) {
    // A clock that went back must not stop a job from ending.
    now = std::max({now, job.create_time, job.start_time.value_or(now)});
    job.state = state;
    ++job.revision;
    if (state == JobState::Running) {
        job.start_time = now;
        job.retry_time.reset();
    }
    if (!is_held(state)) {
        job.worker.clear();
    }
    if (is_terminal(state)) {
        job.end_time = now;
        job.retry_time.reset();
    }
    Statement statement(connection,
                        "INSERT INTO events (job, sequence, time, kind, payload, state, attempt) "
                        "VALUES (?, ?, ?, ?, x'', ?, ?)");
    statement.bind(job.number)
        .bind(++job.last_sequence)
        .bind(to_row(now))
        .bind(static_cast<std::int64_t>(EventKind::State))
        .bind(state_name(job.state))
        .bind(job.attempt);
    statement.run();
    update(connection, job);
}

void append_events(Connection& connection, JobRecord& job, std::span<const NewEvent> events) {
    for (const NewEvent& event : events) {
        Statement statement(connection,
                            "INSERT INTO events (job, sequence, time, kind, payload) "
                            "VALUES (?, ?, ?, ?, ?)");
        statement.bind(job.number)
            .bind(++job.last_sequence)
            .bind(to_row(event.time))
            .bind(static_cast<std::int64_t>(event.kind))
            .bind_blob(event.payload);
        statement.run();
    }
}

void insert_artifact(Connection& connection, const std::string& tenant, const ArtifactId& artifact,
                     Time now) {
    Statement statement(connection,
                        "INSERT INTO artifacts (tenant, sha256, size, create_time) "
                        "VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING");
    statement.bind(tenant).bind(artifact.sha256).bind(artifact.size).bind(to_row(now));
    statement.run();
}

void refer(Connection& connection, const JobRecord& job, std::string_view role,
           const std::string& sha256) {
    Statement statement(connection,
                        "INSERT INTO job_artifacts (job, role, tenant, sha256) "
                        "VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING");
    statement.bind(job.number).bind(role).bind(job.key.tenant).bind(sha256);
    statement.run();
}

}  // namespace remesh::sqlite
