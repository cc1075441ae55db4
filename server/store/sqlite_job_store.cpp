#include "server/store/sqlite_job_store.h"

#include <map>
#include <string_view>
#include <utility>

#include "server/store/data_dir.h"
#include "server/store/sqlite_schema.h"
#include "server/store/sqlite_store.h"

namespace remesh {
namespace sqlite {
namespace {

Creation refusal(Creation::Verdict verdict, std::int64_t limit) {
    return {verdict, {}, {}, limit};
}

std::int64_t count_queued(Connection& connection, const std::string& tenant) {
    Statement row(connection, "SELECT COUNT(*) FROM jobs WHERE state = 'queued' AND tenant = ?");
    row.bind(tenant);
    row.next();
    return row.integer(0);
}

/// Of rows with tenant and id.
std::vector<JobKey> keys_of(Statement& row) {
    std::vector<JobKey> jobs;
    while (row.next()) {
        jobs.push_back({row.text(0), row.text(1)});
    }
    return jobs;
}

/// What stands against a job whose request id is new.
std::optional<Creation> find_obstacle(Connection& connection, const NewJob& job,
                                      const QueueLimits& limits) {
    for (const std::string& input : job.inputs) {
        if (!find_artifact(connection, job.key.tenant, input)) {
            return Creation{Creation::Verdict::MissingInput, {}, input, 0};
        }
    }
    if (connection.integer("SELECT COUNT(*) FROM jobs WHERE state = 'queued'") >=
        limits.max_queued) {
        return refusal(Creation::Verdict::QueueFull, limits.max_queued);
    }
    const TenantPolicy policy = find_policy(connection, job.key.tenant);
    const std::int64_t max_queued = policy.max_queued.value_or(limits.max_queued_of_tenant);
    if (count_queued(connection, job.key.tenant) >= max_queued) {
        return refusal(Creation::Verdict::TenantQueueFull, max_queued);
    }
    const auto max_bytes = policy.max_bytes ? policy.max_bytes : limits.max_bytes_of_tenant;
    if (max_bytes && stored_bytes(connection, job.key.tenant) >= *max_bytes) {
        return refusal(Creation::Verdict::TenantBytesFull, *max_bytes);
    }
    return std::nullopt;
}

// The job whose result answers those of a tenant and cache key.
constexpr std::string_view kResult =
    "FROM jobs WHERE tenant = ? AND cache_key = ? AND state = 'succeeded' "
    "ORDER BY number DESC LIMIT 1";

/// Ends a new job with the result of another one that has the same cache key, if there is one.
void answer_from_cache(Connection& connection, JobRecord& job, const std::string& cache_key,
                       Time now) {
    std::int64_t source = 0;
    {
        Statement row(connection, std::string("SELECT number, id, outcome ").append(kResult));
        row.bind(job.key.tenant).bind(cache_key);
        if (!row.next()) {
            return;
        }
        source = row.integer(0);
        job.origin = row.text(1);
        job.outcome = row.text(2);
    }
    Statement outputs(connection,
                      "INSERT INTO job_artifacts (job, role, tenant, sha256) "
                      "SELECT ?, role, tenant, sha256 FROM job_artifacts "
                      "WHERE job = ? AND role = 'output'");
    outputs.bind(job.number).bind(source);
    outputs.run();
    Statement origin(connection, "UPDATE jobs SET origin = ? WHERE number = ?");
    origin.bind(job.origin).bind(job.number);
    origin.run();
    job.start_time = now;
    enter(connection, job, JobState::Succeeded, now);
}

}  // namespace

Store::Store(const std::filesystem::path& file)
    : directory_(file.parent_path()),
      writer_(file.string(), Connection::Mode::ReadWrite),
      reader_(file.string(), Connection::Mode::ReadWrite),
      bell_(file.string() + "-bell") {
    require_own(writer_);
    writer_.execute("PRAGMA journal_mode = WAL");
    // What is deleted is overwritten: specs and reports tell about patients.
    writer_.execute("PRAGMA secure_delete = ON");
    writer_.execute("PRAGMA synchronous = FULL");
    migrate(writer_);
    writer_.execute("PRAGMA foreign_keys = ON");
}

Creation Store::create(const NewJob& job, const QueueLimits& limits, Time now) {
    Write write(*this);
    Connection& connection = write.connection();
    if (!job.request_id.empty()) {
        Statement row(connection, select_jobs("WHERE tenant = ? AND request_id = ?"));
        row.bind(job.key.tenant).bind(job.request_id);
        if (row.next()) {
            auto known = job_of(row);
            return known.spec == job.spec ? Creation{Creation::Verdict::Repeated, known, {}, 0}
                                          : refusal(Creation::Verdict::Conflict, 0);
        }
    }
    if (auto obstacle = find_obstacle(connection, job, limits)) {
        return *obstacle;
    }
    require_room(directory_, static_cast<std::int64_t>(job.spec.size()));
    insert_job(connection, job, now);
    auto record = find_job(connection, job.key);
    enter(connection, *record, JobState::Queued, now);
    for (const std::string& input : job.inputs) {
        refer(connection, *record, "input", input);
    }
    if (job.may_reuse && !job.cache_key.empty()) {
        answer_from_cache(connection, *record, job.cache_key, now);
    }
    write.commit_and_ring();
    return {Creation::Verdict::Created, record, {}, 0};
}

std::optional<JobRecord> Store::find(const JobKey& key) {
    return read([&](Connection& connection) { return find_job(connection, key); });
}

std::vector<std::string> Store::reusable_outputs(const std::string& tenant,
                                                 const std::string& cache_key) {
    return read([&](Connection& connection) {
        Statement row(connection,
                      std::string("SELECT DISTINCT sha256 FROM job_artifacts WHERE role = 'output' "
                                  "AND job = (SELECT number ")
                          .append(kResult)
                          .append(") ORDER BY sha256"));
        row.bind(tenant).bind(cache_key);
        std::vector<std::string> digests;
        while (row.next()) {
            digests.push_back(row.text(0));
        }
        return digests;
    });
}

std::vector<JobRecord> Store::list(const ListQuery& query) {
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
    return read([&](Connection& connection) {
        Statement row(connection, select_jobs(where));
        row.bind(query.tenant);
        if (query.before) {
            row.bind(*query.before);
        }
        for (const JobState state : query.states) {
            row.bind(state_name(state));
        }
        row.bind(static_cast<std::int64_t>(query.limit));
        std::vector<JobRecord> jobs;
        while (row.next()) {
            jobs.push_back(job_of(row));
        }
        return jobs;
    });
}

std::int64_t Store::queue_position(const JobRecord& job) {
    if (job.state != JobState::Queued) {
        return 0;
    }
    return read([&](Connection& connection) {
        Statement own(connection,
                      "SELECT COUNT(*) FROM jobs WHERE state = 'queued' AND tenant = ?1 "
                      "AND (priority > ?2 OR (priority = ?2 AND number < ?3))");
        own.bind(job.key.tenant).bind(job.priority).bind(job.number);
        own.next();
        return own.integer(0);
    });
}

std::vector<StoredEvent> Store::events_after(const JobKey& key, std::int64_t sequence,
                                             std::size_t limit) {
    return read([&](Connection& connection) {
        Statement row(connection,
                      "SELECT sequence, kind, time, payload, state, attempt FROM events "
                      "WHERE job = (SELECT number FROM jobs WHERE tenant = ? AND id = ?) "
                      "AND sequence > ? ORDER BY sequence LIMIT ?");
        row.bind(key.tenant).bind(key.id).bind(sequence).bind(static_cast<std::int64_t>(limit));
        std::vector<StoredEvent> events;
        while (row.next()) {
            events.push_back(event_of(row));
        }
        return events;
    });
}

std::string Store::last_progress(const JobKey& key) {
    return read([&](Connection& connection) {
        Statement row(connection,
                      "SELECT kind, payload FROM events "
                      "WHERE job = (SELECT number FROM jobs WHERE tenant = ? AND id = ?) "
                      "AND (kind = 1 OR state = 'running') ORDER BY sequence DESC LIMIT 1");
        row.bind(key.tenant).bind(key.id);
        return row.next() && row.integer(0) == static_cast<int>(EventKind::Progress)
                   ? row.text(1)
                   : std::string();
    });
}

std::vector<JobKey> Store::ended_before(Time time, std::size_t limit) {
    return read([&](Connection& connection) {
        Statement row(connection,
                      "SELECT tenant, id FROM jobs WHERE end_time < ? "
                      "ORDER BY end_time, number LIMIT ?");
        return keys_of(row.bind(to_row(time)).bind(static_cast<std::int64_t>(limit)));
    });
}

std::vector<JobKey> Store::ended_since(const std::optional<std::string>& tenant, Time time,
                                       std::size_t limit) {
    return read([&](Connection& connection) {
        Statement row(connection, std::string("SELECT tenant, id FROM jobs WHERE end_time >= ?") +
                                      (tenant ? " AND tenant = ?" : "") +
                                      " ORDER BY end_time DESC, number DESC LIMIT ?");
        row.bind(to_row(time));
        if (tenant) {
            row.bind(*tenant);
        }
        return keys_of(row.bind(static_cast<std::int64_t>(limit)));
    });
}

std::optional<std::chrono::microseconds> Store::mean_run_time(const std::string& tenant,
                                                              std::size_t count) {
    return read([&](Connection& connection) -> std::optional<std::chrono::microseconds> {
        Statement row(
            connection,
            "SELECT CAST(AVG(time) AS INTEGER) FROM (SELECT end_time - start_time AS time "
            "FROM jobs WHERE tenant = ? AND end_time IS NOT NULL AND state = 'succeeded' "
            "AND attempt > 0 ORDER BY end_time DESC, number DESC LIMIT ?)");
        row.bind(tenant).bind(static_cast<std::int64_t>(count));
        row.next();
        const auto mean = row.maybe_integer(0);
        return mean ? std::optional(std::chrono::microseconds(*mean)) : std::nullopt;
    });
}

StoreFigures Store::figures() {
    return read([](Connection& connection) {
        Statement row(connection,
                      "SELECT state, COUNT(*), MIN(create_time) FROM jobs GROUP BY state");
        StoreFigures figures;
        while (row.next()) {
            const JobState state = state_of(row.text(0));
            figures.jobs[state] = row.integer(1);
            if (state == JobState::Queued) {
                figures.oldest_queued = to_time(row.integer(2));
            }
        }
        return figures;
    });
}

std::vector<TenantBacklog> Store::backlogs() {
    return read([](Connection& connection) {
        std::map<std::string, TenantBacklog> backlogs;
        Statement queued(connection,
                         "SELECT tenant, COUNT(*), MIN(create_time) FROM jobs "
                         "WHERE state = 'queued' GROUP BY tenant");
        while (queued.next()) {
            TenantBacklog& backlog = backlogs[queued.text(0)];
            backlog.queued = queued.integer(1);
            backlog.oldest_queued = to_time(queued.integer(2));
        }
        Statement held(connection,
                       "SELECT tenant, COUNT(*) FROM jobs "
                       "WHERE state IN ('running', 'cancelling') GROUP BY tenant");
        while (held.next()) {
            backlogs[held.text(0)].running = held.integer(1);
        }
        std::vector<TenantBacklog> sorted;
        for (auto& [tenant, backlog] : backlogs) {
            backlog.tenant = tenant;
            sorted.push_back(std::move(backlog));
        }
        return sorted;
    });
}

}  // namespace sqlite

std::unique_ptr<JobStore> open_sqlite_store(const std::filesystem::path& file) {
    return std::make_unique<sqlite::Store>(file);
}

void require_whole_database(const std::filesystem::path& file) {
    std::error_code none;
    if (std::filesystem::file_size(file, none) == 0 || none) {
        return;
    }
    sqlite::Connection connection(file.string(), sqlite::Connection::Mode::ReadOnly);
    std::string problem;
    try {
        sqlite::Statement row(connection, "PRAGMA quick_check(1)");
        problem = row.next() ? row.text(0) : "no answer";
    } catch (const StoreError& error) {
        problem = error.what();
    }
    if (problem != "ok") {
        throw StoreError("store: " + file.string() +
                         " is damaged or no database, and was left as it is; restore it from a "
                         "backup, or move it away to begin anew: " +
                         problem);
    }
}

void check_sqlite_store(const std::filesystem::path& file) {
    require_whole_database(file);
    std::error_code none;
    if (std::filesystem::file_size(file, none) > 0 && !none) {
        sqlite::Connection connection(file.string(), sqlite::Connection::Mode::ReadOnly);
        sqlite::require_own(connection);
    }
}

}  // namespace remesh
