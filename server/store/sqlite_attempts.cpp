#include "server/store/fair_share.h"
#include "server/store/sqlite_store.h"

// What workers do to jobs.

namespace remesh::sqlite {
namespace {

// Not one that waits after a lost attempt; ?1 is now, ?2 the latest time that can be meant.
constexpr std::string_view kIsReady =
    "state = 'queued' AND (retry_time IS NULL OR retry_time <= ?1 OR retry_time > ?2)";

void bind_now(Statement& statement, Time now) {
    statement.bind(to_row(now)).bind(to_row(now + JobStore::kLongestRetry));
}

std::vector<TenantLoad> load_tenants(Connection& connection, const ClaimRequest& request,
                                     Time now) {
    std::string sql =
        "SELECT q.tenant, COALESCE(t.weight, 1), t.max_running, COALESCE(t.used, 0), "
        "(SELECT COUNT(*) FROM jobs AS r WHERE r.tenant = q.tenant "
        "AND r.state IN ('running', 'cancelling')) FROM (SELECT DISTINCT tenant FROM jobs WHERE ";
    sql.append(kIsReady).append(") AS q LEFT JOIN tenants AS t ON t.name = q.tenant");
    Statement row(connection, sql);
    bind_now(row, now);
    std::vector<TenantLoad> loads;
    while (row.next()) {
        const auto max_running = row.maybe_integer(2);
        loads.push_back({row.text(0), static_cast<int>(row.integer(1)), row.integer(4),
                         max_running ? max_running : request.max_running_of_tenant,
                         row.integer(3)});
    }
    return loads;
}

JobRecord first_of(Connection& connection, const std::string& tenant, Time now) {
    std::string rest = "WHERE tenant = ?3 AND ";
    rest.append(kIsReady).append(" ORDER BY priority DESC, number LIMIT 1");
    Statement row(connection, select_jobs(rest));
    bind_now(row, now);
    row.bind(tenant);
    row.next();
    return job_of(row);
}

void set_used(Connection& connection, const std::string& tenant, std::int64_t used) {
    Statement statement(connection,
                        "INSERT INTO tenants (name, weight, used) VALUES (?, 1, ?) "
                        "ON CONFLICT (name) DO UPDATE SET used = excluded.used");
    statement.bind(tenant).bind(used);
    statement.run();
}

void charge_claim(Connection& connection, const TenantLoad& load, std::int64_t level) {
    const std::int64_t used = std::max(load.used, level);
    set_used(connection, load.tenant, used + charge_of_claim(load.weight));
    Statement statement(connection, "UPDATE queue_level SET used = ?");
    statement.bind(used);
    statement.run();
}

/// The tenant pays for the time that its job had a worker.
void charge_attempt(Connection& connection, const JobRecord& job, Time now) {
    const int weight = find_policy(connection, job.key.tenant).weight;
    Statement statement(connection, "UPDATE tenants SET used = used + ? WHERE name = ?");
    statement.bind(charge_of_attempt(now - job.start_time.value_or(now), weight))
        .bind(job.key.tenant);
    statement.run();
}

}  // namespace

template <typename Next>
std::optional<JobRecord> Store::end_attempt(const Claim& claim, Time now, Next next) {
    Write write(*this);
    Connection& connection = write.connection();
    auto job = find_claimed(connection, claim);
    if (!job) {
        return std::nullopt;
    }
    charge_attempt(connection, *job, now);
    const std::optional<JobState> state = next(connection, *job);
    if (!state) {
        return std::nullopt;
    }
    enter(connection, *job, *state, now);
    write.commit_and_ring();
    return job;
}

std::optional<JobRecord> Store::claim(const ClaimRequest& request, Time now) {
    const bool is_empty = read([](Connection& connection) {
        return connection.integer("SELECT EXISTS (SELECT 1 FROM jobs WHERE state = 'queued')") == 0;
    });
    if (is_empty) {
        return std::nullopt;  // no lock for nothing: idle workers look often
    }
    Write write(*this);
    Connection& connection = write.connection();
    const std::int64_t level = connection.integer("SELECT used FROM queue_level");
    const auto loads = load_tenants(connection, request, now);
    const auto chosen = next_tenant(loads, level);
    if (!chosen) {
        return std::nullopt;
    }
    JobRecord job = first_of(connection, loads[*chosen].tenant, now);
    charge_claim(connection, loads[*chosen], level);
    ++job.attempt;
    ++job.epoch;
    job.worker = request.worker;
    job.beat = 0;
    enter(connection, job, JobState::Running, now);
    write.commit_and_ring();
    return job;
}

std::optional<JobState> Store::renew(const Claim& claim) {
    Write write(*this);
    const auto job = find_claimed(write.connection(), claim);
    if (!job) {
        return std::nullopt;
    }
    Statement statement(write.connection(), "UPDATE jobs SET beat = beat + 1 WHERE number = ?");
    statement.bind(job->number);
    statement.run();
    write.commit();
    return job->state;
}

std::optional<std::int64_t> Store::append(const Claim& claim, std::span<const NewEvent> events,
                                          std::span<const ArtifactId> previews, Time now) {
    Write write(*this);
    Connection& connection = write.connection();
    auto job = find_claimed(connection, claim);
    if (!job) {
        return std::nullopt;
    }
    append_events(connection, *job, events);
    for (const ArtifactId& preview : previews) {
        insert_artifact(connection, claim.key.tenant, preview, now);
        refer(connection, *job, "preview", preview.sha256);
    }
    write.commit_and_ring();
    return job->last_sequence;
}

std::optional<JobRecord> Store::settle(const Claim& claim, const Settlement& settlement, Time now) {
    return end_attempt(claim, now, [&](Connection& connection, JobRecord& job) {
        append_events(connection, job, settlement.events);
        if (job.state == JobState::Cancelling) {
            return JobState::Cancelled;
        }
        job.outcome = settlement.outcome;
        for (const ArtifactId& output : settlement.outputs) {
            insert_artifact(connection, claim.key.tenant, output, now);
            refer(connection, job, "output", output.sha256);
        }
        return settlement.state;
    });
}

std::optional<JobRecord> Store::give_back(const Claim& claim, Time now) {
    return end_attempt(claim, now, [](Connection&, JobRecord& job) {
        if (job.state == JobState::Cancelling) {
            return JobState::Cancelled;
        }
        --job.attempt;
        return JobState::Queued;
    });
}

std::optional<JobRecord> Store::lose(const Claim& claim, const Loss& loss, Time now) {
    return end_attempt(claim, now, [&](Connection&, JobRecord& job) -> std::optional<JobState> {
        if (loss.seen_beat && *loss.seen_beat != job.beat) {
            return std::nullopt;
        }
        if (job.state == JobState::Cancelling) {
            return JobState::Cancelled;
        }
        job.crashes += loss.is_crash ? 1 : 0;
        if (job.crashes >= loss.max_crashes || job.attempt >= job.max_attempts) {
            job.outcome = loss.outcome;
            return loss.last_state;
        }
        job.retry_time = loss.retry_time;
        return JobState::Queued;
    });
}

std::vector<JobRecord> Store::held() {
    return read([](Connection& connection) {
        Statement row(connection,
                      select_jobs("WHERE state IN ('running', 'cancelling') ORDER BY number"));
        std::vector<JobRecord> jobs;
        while (row.next()) {
            jobs.push_back(job_of(row));
        }
        return jobs;
    });
}

std::optional<JobRecord> Store::request_cancel(const JobKey& key, Time now) {
    Write write(*this);
    auto job = find_job(write.connection(), key);
    if (!job || is_terminal(job->state) || job->state == JobState::Cancelling) {
        return job;
    }
    enter(write.connection(), *job,
          job->state == JobState::Queued ? JobState::Cancelled : JobState::Cancelling, now);
    write.commit_and_ring();
    return job;
}

}  // namespace remesh::sqlite
