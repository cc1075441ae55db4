#include "server/store/sqlite_job_store.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <string_view>
#include <utility>

#include "server/store/sqlite.h"
#include "server/store/sqlite_schema.h"

namespace remesh {
namespace {

using sqlite::Connection;
using sqlite::Statement;
using sqlite::Transaction;

// In the order of JobState.
constexpr std::array<std::string_view, 7> kStateNames{
    "queued", "running", "cancelling", "succeeded", "failed", "cancelled", "quarantined"};

std::string_view name_of(JobState state) {
    return kStateNames[static_cast<std::size_t>(state)];
}

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

std::optional<Time> to_time(const std::optional<std::int64_t>& row) {
    return row ? std::optional(to_time(*row)) : std::nullopt;
}

std::optional<std::int64_t> to_row(const std::optional<Time>& time) {
    return time ? std::optional(to_row(*time)) : std::nullopt;
}

constexpr std::string_view kJobColumns =
    "tenant, id, number, spec, priority, state, attempt, max_attempts, epoch, revision, "
    "create_time, start_time, end_time, outcome, last_sequence";

JobRecord job_of(const Statement& row) {
    JobRecord job;
    job.key = {row.text(0), row.text(1)};
    job.number = row.integer(2);
    job.spec = row.text(3);
    job.priority = static_cast<int>(row.integer(4));
    job.state = state_of(row.text(5));
    job.attempt = static_cast<int>(row.integer(6));
    job.max_attempts = static_cast<int>(row.integer(7));
    job.epoch = row.integer(8);
    job.revision = row.integer(9);
    job.create_time = to_time(row.integer(10));
    job.start_time = to_time(row.maybe_integer(11));
    job.end_time = to_time(row.maybe_integer(12));
    job.outcome = row.text(13);
    job.last_sequence = row.integer(14);
    return job;
}

std::string select_jobs(std::string_view rest) {
    std::string sql = "SELECT ";
    return sql.append(kJobColumns).append(" FROM jobs ").append(rest);
}

std::optional<JobRecord> find_in(Connection& connection, const JobKey& key) {
    Statement row(connection, select_jobs("WHERE tenant = ? AND id = ?"));
    row.bind(key.tenant).bind(key.id);
    return row.next() ? std::optional(job_of(row)) : std::nullopt;
}

/// Writes what may change of a job, raising its revision.
void update(Connection& connection, JobRecord& job) {
    ++job.revision;
    Statement statement(connection,
                        "UPDATE jobs SET state = ?, attempt = ?, epoch = ?, revision = ?, "
                        "start_time = ?, end_time = ?, outcome = ?, last_sequence = ? "
                        "WHERE number = ?");
    statement.bind(name_of(job.state))
        .bind(job.attempt)
        .bind(job.epoch)
        .bind(job.revision)
        .bind(to_row(job.start_time))
        .bind(to_row(job.end_time))
        .bind_blob(job.outcome)
        .bind(job.last_sequence)
        .bind(job.number);
    statement.run();
}

void append_state_event(Connection& connection, JobRecord& job, Time now) {
    Statement statement(connection,
                        "INSERT INTO events (job, sequence, time, kind, payload, state, attempt) "
                        "VALUES (?, ?, ?, ?, x'', ?, ?)");
    statement.bind(job.number)
        .bind(++job.last_sequence)
        .bind(to_row(now))
        .bind(static_cast<std::int64_t>(EventKind::State))
        .bind(name_of(job.state))
        .bind(job.attempt);
    statement.run();
}

/// Makes the job what it becomes: the state event and the row, for one transaction.
void enter(Connection& connection, JobRecord& job, JobState state, Time now) {
    job.state = state;
    if (is_terminal(state)) {
        job.end_time = now;
    }
    append_state_event(connection, job, now);
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

std::optional<ArtifactId> find_artifact_in(Connection& connection, const std::string& tenant,
                                           const std::string& sha256) {
    Statement row(connection, "SELECT size FROM artifacts WHERE tenant = ? AND sha256 = ?");
    row.bind(tenant).bind(sha256);
    return row.next() ? std::optional(ArtifactId{sha256, row.integer(0)}) : std::nullopt;
}

/// The job, if the claim may still write to it.
std::optional<JobRecord> find_claimed(Connection& connection, const Claim& claim) {
    auto job = find_in(connection, claim.key);
    const bool is_held = job && job->epoch == claim.epoch &&
                         (job->state == JobState::Running || job->state == JobState::Cancelling);
    return is_held ? job : std::nullopt;
}

/// One connection writes, another reads, so that reading never waits for a disk.
class SqliteJobStore final : public JobStore {
public:
    explicit SqliteJobStore(const std::string& path) : writer_(path), reader_(path) {
        writer_.execute("PRAGMA journal_mode = WAL");
        for (Connection* connection : {&writer_, &reader_}) {
            connection->execute("PRAGMA synchronous = FULL");
            connection->execute("PRAGMA foreign_keys = ON");
        }
        sqlite::migrate(writer_);
    }

    Creation create(const NewJob& job, std::int64_t max_queued, Time now) override;
    std::optional<JobRecord> find(const JobKey& key) override {
        const std::scoped_lock lock(reader_mutex_);
        return find_in(reader_, key);
    }
    std::vector<JobRecord> list(const ListQuery& query) override;
    std::int64_t queue_position(const JobRecord& job) override;
    std::vector<StoredEvent> events_after(const JobKey& key, std::int64_t sequence,
                                          std::size_t limit) override;

    std::optional<JobRecord> claim(Time now) override;
    std::optional<std::int64_t> append(const Claim& claim, std::span<const NewEvent> events,
                                       std::span<const ArtifactId> previews, Time now) override;
    std::optional<JobRecord> settle(const Claim& claim, const Settlement& settlement,
                                    Time now) override;
    std::optional<JobRecord> give_back(const Claim& claim, Time now) override;
    std::optional<JobRecord> lose(const Claim& claim, const std::string& outcome,
                                  Time now) override;
    std::vector<JobRecord> unsettled() override;
    std::optional<JobRecord> request_cancel(const JobKey& key, Time now) override;
    Removal remove(const JobKey& key, std::optional<std::int64_t> revision,
                   std::vector<std::string>* artifacts) override;

    void add_artifact(const std::string& tenant, const ArtifactId& artifact, Time now) override;
    std::optional<ArtifactId> find_artifact(const std::string& tenant,
                                            const std::string& sha256) override {
        const std::scoped_lock lock(reader_mutex_);
        return find_artifact_in(reader_, tenant, sha256);
    }
    std::vector<std::string> drop_previews(const JobKey& key,
                                           std::span<const std::string> keep) override;
    bool remove_artifact(const std::string& tenant, const std::string& sha256) override;
    std::vector<JobKey> unreferenced_artifacts(Time before) override;
    StoreFigures figures() override;

private:
    std::mutex writer_mutex_;
    Connection writer_;  // needs writer_mutex_

    std::mutex reader_mutex_;
    Connection reader_;  // needs reader_mutex_
};

Creation SqliteJobStore::create(const NewJob& job, std::int64_t max_queued, Time now) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    if (!job.request_id.empty()) {
        Statement row(writer_, select_jobs("WHERE tenant = ? AND request_id = ?"));
        row.bind(job.key.tenant).bind(job.request_id);
        if (row.next()) {
            auto known = job_of(row);
            return known.spec == job.spec ? Creation{Creation::Verdict::Repeated, known, {}}
                                          : Creation{Creation::Verdict::Conflict, {}, {}};
        }
    }
    for (const std::string& input : job.inputs) {
        if (!find_artifact_in(writer_, job.key.tenant, input)) {
            return {Creation::Verdict::MissingInput, {}, input};
        }
    }
    {
        Statement count(writer_, "SELECT COUNT(*) FROM jobs WHERE state = 'queued'");
        count.next();
        if (count.integer(0) >= max_queued) {
            return {Creation::Verdict::QueueFull, {}, {}};
        }
    }
    Statement statement(writer_,
                        "INSERT INTO jobs (tenant, id, request_id, spec, priority, state, attempt, "
                        "max_attempts, epoch, revision, create_time, outcome, last_sequence) "
                        "VALUES (?, ?, ?, ?, ?, 'queued', 0, ?, 0, 0, ?, x'', 0)");
    statement.bind(job.key.tenant).bind(job.key.id);
    job.request_id.empty() ? statement.bind_null() : statement.bind(job.request_id);
    statement.bind_blob(job.spec).bind(job.priority).bind(job.max_attempts).bind(to_row(now));
    statement.run();

    auto record = find_in(writer_, job.key);
    enter(writer_, *record, JobState::Queued, now);
    for (const std::string& input : job.inputs) {
        refer(writer_, *record, "input", input);
    }
    transaction.commit();
    return {Creation::Verdict::Created, record, {}};
}

std::vector<JobRecord> SqliteJobStore::list(const ListQuery& query) {
    std::string where = "WHERE tenant = ?";
    if (query.before) {
        where += " AND number < ?";
    }
    if (!query.states.empty()) {
        where += " AND state IN (?";
        for (std::size_t i = 1; i < query.states.size(); ++i) {
            where += ", ?";
        }
        where += ")";
    }
    where += " ORDER BY number DESC LIMIT ?";

    const std::scoped_lock lock(reader_mutex_);
    Statement row(reader_, select_jobs(where));
    row.bind(query.tenant);
    if (query.before) {
        row.bind(*query.before);
    }
    for (const JobState state : query.states) {
        row.bind(name_of(state));
    }
    row.bind(static_cast<std::int64_t>(query.limit));
    std::vector<JobRecord> jobs;
    while (row.next()) {
        jobs.push_back(job_of(row));
    }
    return jobs;
}

std::int64_t SqliteJobStore::queue_position(const JobRecord& job) {
    if (job.state != JobState::Queued) {
        return 0;
    }
    const std::scoped_lock lock(reader_mutex_);
    Statement row(reader_,
                  "SELECT COUNT(*) FROM jobs WHERE state = 'queued' "
                  "AND (priority > ?1 OR (priority = ?1 AND number < ?2))");
    row.bind(job.priority).bind(job.number);
    row.next();
    return row.integer(0);
}

std::vector<StoredEvent> SqliteJobStore::events_after(const JobKey& key, std::int64_t sequence,
                                                      std::size_t limit) {
    const std::scoped_lock lock(reader_mutex_);
    Statement row(reader_,
                  "SELECT sequence, kind, time, payload, state, attempt FROM events "
                  "WHERE job = (SELECT number FROM jobs WHERE tenant = ? AND id = ?) "
                  "AND sequence > ? ORDER BY sequence LIMIT ?");
    row.bind(key.tenant).bind(key.id).bind(sequence).bind(static_cast<std::int64_t>(limit));
    std::vector<StoredEvent> events;
    while (row.next()) {
        StoredEvent event{row.integer(0), static_cast<EventKind>(row.integer(1)),
                          to_time(row.integer(2)), row.text(3)};
        if (event.kind == EventKind::State) {
            event.state = state_of(row.text(4));
            event.attempt = static_cast<int>(row.integer(5));
        }
        events.push_back(std::move(event));
    }
    return events;
}

std::optional<JobRecord> SqliteJobStore::claim(Time now) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    std::optional<JobRecord> job;
    {
        Statement row(writer_,
                      select_jobs("WHERE state = 'queued' ORDER BY priority DESC, number LIMIT 1"));
        if (!row.next()) {
            return std::nullopt;
        }
        job = job_of(row);
    }
    ++job->attempt;
    ++job->epoch;
    job->start_time = now;
    enter(writer_, *job, JobState::Running, now);
    transaction.commit();
    return job;
}

std::optional<std::int64_t> SqliteJobStore::append(const Claim& claim,
                                                   std::span<const NewEvent> events,
                                                   std::span<const ArtifactId> previews, Time now) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    auto job = find_claimed(writer_, claim);
    if (!job) {
        return std::nullopt;
    }
    append_events(writer_, *job, events);
    for (const ArtifactId& preview : previews) {
        insert_artifact(writer_, claim.key.tenant, preview, now);
        refer(writer_, *job, "preview", preview.sha256);
    }
    update(writer_, *job);
    transaction.commit();
    return job->last_sequence;
}

std::optional<JobRecord> SqliteJobStore::settle(const Claim& claim, const Settlement& settlement,
                                                Time now) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    auto job = find_claimed(writer_, claim);
    if (!job) {
        return std::nullopt;
    }
    append_events(writer_, *job, settlement.events);
    const bool is_cancelled = job->state == JobState::Cancelling;
    if (!is_cancelled) {
        job->outcome = settlement.outcome;
    }
    enter(writer_, *job, is_cancelled ? JobState::Cancelled : settlement.state, now);
    if (!is_cancelled) {
        for (const ArtifactId& output : settlement.outputs) {
            insert_artifact(writer_, claim.key.tenant, output, now);
            refer(writer_, *job, "output", output.sha256);
        }
    }
    transaction.commit();
    return job;
}

std::optional<JobRecord> SqliteJobStore::give_back(const Claim& claim, Time now) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    auto job = find_claimed(writer_, claim);
    if (!job) {
        return std::nullopt;
    }
    if (job->state == JobState::Cancelling) {
        enter(writer_, *job, JobState::Cancelled, now);
    } else {
        --job->attempt;
        enter(writer_, *job, JobState::Queued, now);
    }
    transaction.commit();
    return job;
}

std::optional<JobRecord> SqliteJobStore::lose(const Claim& claim, const std::string& outcome,
                                              Time now) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    auto job = find_claimed(writer_, claim);
    if (!job) {
        return std::nullopt;
    }
    if (job->state == JobState::Cancelling) {
        enter(writer_, *job, JobState::Cancelled, now);
    } else if (job->attempt >= job->max_attempts) {
        job->outcome = outcome;
        enter(writer_, *job, JobState::Quarantined, now);
    } else {
        enter(writer_, *job, JobState::Queued, now);
    }
    transaction.commit();
    return job;
}

std::vector<JobRecord> SqliteJobStore::unsettled() {
    const std::scoped_lock lock(reader_mutex_);
    Statement row(reader_, select_jobs("WHERE state IN ('running', 'cancelling') ORDER BY number"));
    std::vector<JobRecord> jobs;
    while (row.next()) {
        jobs.push_back(job_of(row));
    }
    return jobs;
}

std::optional<JobRecord> SqliteJobStore::request_cancel(const JobKey& key, Time now) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    auto job = find_in(writer_, key);
    if (!job) {
        return std::nullopt;
    }
    if (job->state == JobState::Queued) {
        enter(writer_, *job, JobState::Cancelled, now);
    } else if (job->state == JobState::Running) {
        enter(writer_, *job, JobState::Cancelling, now);
    }
    transaction.commit();
    return job;
}

JobStore::Removal SqliteJobStore::remove(const JobKey& key, std::optional<std::int64_t> revision,
                                         std::vector<std::string>* artifacts) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    const auto job = find_in(writer_, key);
    if (!job) {
        return Removal::NotFound;
    }
    if (!is_terminal(job->state)) {
        return Removal::NotTerminal;
    }
    if (revision && *revision != job->revision) {
        return Removal::OtherRevision;
    }
    {
        Statement row(writer_, "SELECT DISTINCT sha256 FROM job_artifacts WHERE job = ?");
        row.bind(job->number);
        while (row.next()) {
            artifacts->push_back(row.text(0));
        }
    }
    Statement statement(writer_, "DELETE FROM jobs WHERE number = ?");
    statement.bind(job->number);
    statement.run();
    transaction.commit();
    return Removal::Removed;
}

void SqliteJobStore::add_artifact(const std::string& tenant, const ArtifactId& artifact, Time now) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    insert_artifact(writer_, tenant, artifact, now);
    transaction.commit();
}

std::vector<std::string> SqliteJobStore::drop_previews(const JobKey& key,
                                                       std::span<const std::string> keep) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    const auto job = find_in(writer_, key);
    if (!job) {
        return {};
    }
    std::vector<std::string> dropped;
    {
        Statement row(writer_,
                      "SELECT sha256 FROM job_artifacts WHERE job = ? AND role = 'preview'");
        row.bind(job->number);
        while (row.next()) {
            auto sha256 = row.text(0);
            if (std::find(keep.begin(), keep.end(), sha256) == keep.end()) {
                dropped.push_back(std::move(sha256));
            }
        }
    }
    for (const std::string& sha256 : dropped) {
        Statement statement(
            writer_, "DELETE FROM job_artifacts WHERE job = ? AND role = 'preview' AND sha256 = ?");
        statement.bind(job->number).bind(sha256);
        statement.run();
    }
    transaction.commit();
    return dropped;
}

bool SqliteJobStore::remove_artifact(const std::string& tenant, const std::string& sha256) {
    const std::scoped_lock lock(writer_mutex_);
    Transaction transaction(writer_);
    Statement statement(writer_,
                        "DELETE FROM artifacts WHERE tenant = ?1 AND sha256 = ?2 AND NOT EXISTS "
                        "(SELECT 1 FROM job_artifacts WHERE tenant = ?1 AND sha256 = ?2)");
    statement.bind(tenant).bind(sha256);
    statement.run();
    const bool is_removed = writer_.changes() > 0;
    transaction.commit();
    return is_removed;
}

std::vector<JobKey> SqliteJobStore::unreferenced_artifacts(Time before) {
    const std::scoped_lock lock(reader_mutex_);
    Statement row(reader_,
                  "SELECT tenant, sha256 FROM artifacts AS a WHERE create_time < ? AND NOT EXISTS "
                  "(SELECT 1 FROM job_artifacts AS j "
                  "WHERE j.tenant = a.tenant AND j.sha256 = a.sha256)");
    row.bind(to_row(before));
    std::vector<JobKey> artifacts;
    while (row.next()) {
        artifacts.push_back({row.text(0), row.text(1)});
    }
    return artifacts;
}

StoreFigures SqliteJobStore::figures() {
    const std::scoped_lock lock(reader_mutex_);
    Statement row(reader_, "SELECT state, count(*), min(create_time) FROM jobs GROUP BY state");
    StoreFigures figures;
    while (row.next()) {
        const JobState state = state_of(row.text(0));
        figures.jobs[state] = row.integer(1);
        if (state == JobState::Queued) {
            figures.oldest_queued = to_time(row.integer(2));
        }
    }
    return figures;
}

}  // namespace

std::unique_ptr<JobStore> open_sqlite_store(const std::filesystem::path& file) {
    return std::make_unique<SqliteJobStore>(file.string());
}

}  // namespace remesh
