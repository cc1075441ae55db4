#include <algorithm>

#include "server/store/sqlite_store.h"

// Artifacts, removal, policies, and what listeners hear.

namespace remesh::sqlite {

JobStore::Removal Store::remove(const JobKey& key, std::optional<std::int64_t> revision,
                                std::vector<std::string>* artifacts) {
    Write write(*this);
    Connection& connection = write.connection();
    const auto job = find_job(connection, key);
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
        Statement row(connection,
                      "SELECT DISTINCT sha256 FROM job_artifacts WHERE job = ? ORDER BY sha256");
        row.bind(job->number);
        while (row.next()) {
            artifacts->push_back(row.text(0));
        }
    }
    Statement statement(connection, "DELETE FROM jobs WHERE number = ?");
    statement.bind(job->number);
    statement.run();
    write.commit_and_ring();
    return Removal::Removed;
}

bool Store::add_artifact(const std::string& tenant, const ArtifactId& artifact,
                         std::optional<std::int64_t> max_bytes, Time now) {
    Write write(*this);
    Connection& connection = write.connection();
    if (sqlite::find_artifact(connection, tenant, artifact.sha256)) {
        return true;
    }
    const TenantPolicy policy = find_policy(connection, tenant);
    const auto limit = policy.max_bytes ? policy.max_bytes : max_bytes;
    if (limit && sqlite::stored_bytes(connection, tenant) + artifact.size > *limit) {
        return false;
    }
    insert_artifact(connection, tenant, artifact, now);
    write.commit();
    return true;
}

std::optional<ArtifactId> Store::find_artifact(const std::string& tenant,
                                               const std::string& sha256) {
    return read(
        [&](Connection& connection) { return sqlite::find_artifact(connection, tenant, sha256); });
}

std::vector<std::string> Store::drop_previews(const JobKey& key,
                                              std::span<const std::string> keep) {
    Write write(*this);
    Connection& connection = write.connection();
    const auto job = find_job(connection, key);
    if (!job) {
        return {};
    }
    std::vector<std::string> dropped;
    {
        Statement row(connection,
                      "SELECT sha256 FROM job_artifacts WHERE job = ? AND role = 'preview' "
                      "ORDER BY sha256");
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
            connection,
            "DELETE FROM job_artifacts WHERE job = ? AND role = 'preview' AND sha256 = ?");
        statement.bind(job->number).bind(sha256);
        statement.run();
    }
    write.commit();
    return dropped;
}

bool Store::remove_artifact(const std::string& tenant, const std::string& sha256) {
    Write write(*this);
    Statement statement(write.connection(),
                        "DELETE FROM artifacts WHERE tenant = ?1 AND sha256 = ?2 AND NOT EXISTS "
                        "(SELECT 1 FROM job_artifacts WHERE tenant = ?1 AND sha256 = ?2)");
    statement.bind(tenant).bind(sha256);
    statement.run();
    const bool is_removed = write.connection().changes() > 0;
    write.commit();
    return is_removed;
}

std::vector<JobKey> Store::unreferenced_artifacts(Time before) {
    return read([&](Connection& connection) {
        Statement row(connection,
                      "SELECT tenant, sha256 FROM artifacts AS a WHERE create_time < ? "
                      "AND NOT EXISTS (SELECT 1 FROM job_artifacts AS j "
                      "WHERE j.tenant = a.tenant AND j.sha256 = a.sha256) "
                      "ORDER BY tenant, sha256");
        row.bind(to_row(before));
        std::vector<JobKey> artifacts;
        while (row.next()) {
            artifacts.push_back({row.text(0), row.text(1)});
        }
        return artifacts;
    });
}

std::int64_t Store::stored_bytes(const std::string& tenant) {
    return read([&](Connection& connection) { return sqlite::stored_bytes(connection, tenant); });
}

void Store::set_policy(const std::string& tenant, const TenantPolicy& policy) {
    Write write(*this);
    Statement statement(write.connection(),
                        "INSERT INTO tenants (name, weight, max_running, max_queued, max_bytes, "
                        "used) VALUES (?, ?, ?, ?, ?, 0) ON CONFLICT (name) DO UPDATE SET "
                        "weight = excluded.weight, max_running = excluded.max_running, "
                        "max_queued = excluded.max_queued, max_bytes = excluded.max_bytes");
    statement.bind(tenant)
        .bind(policy.weight)
        .bind(policy.max_running)
        .bind(policy.max_queued)
        .bind(policy.max_bytes);
    statement.run();
    write.commit();
}

TenantPolicy Store::policy(const std::string& tenant) {
    return read([&](Connection& connection) { return find_policy(connection, tenant); });
}

/// A cursor into the numbers of all events.
class Store::Feed final : public ChangeFeed {
public:
    explicit Feed(Store& store) : store_(store), listener_(store.bell_), last_(newest()) {}

    std::vector<JobKey> next(std::chrono::milliseconds timeout,
                             const std::stop_token& stop) override {
        auto changed = take();
        if (changed.empty()) {
            listener_.wait(timeout, stop);
            changed = take();
        }
        return changed;
    }

private:
    std::int64_t newest() {
        return store_.read([](Connection& connection) {
            return connection.integer("SELECT COALESCE(MAX(id), 0) FROM events");
        });
    }
    std::vector<JobKey> take() {
        return store_.read([this](Connection& connection) {
            std::vector<JobKey> keys;
            Statement row(connection,
                          "SELECT tenant, jobs.id, MAX(events.id) FROM events "
                          "JOIN jobs ON number = job WHERE events.id > ? GROUP BY job");
            row.bind(last_);
            std::int64_t newest = last_;
            while (row.next()) {
                keys.push_back({row.text(0), row.text(1)});
                newest = std::max(newest, row.integer(2));
            }
            last_ = newest;
            return keys;
        });
    }

    Store& store_;
    BellListener listener_;
    std::int64_t last_;
};

std::unique_ptr<ChangeFeed> Store::follow() {
    return std::make_unique<Feed>(*this);
}

}  // namespace remesh::sqlite
