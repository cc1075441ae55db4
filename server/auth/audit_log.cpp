#include "server/auth/audit_log.h"

#include <initializer_list>
#include <string_view>
#include <utility>

#include "server/auth/access_database.h"
#include "server/store/digest.h"

namespace remesh {
namespace {

constexpr std::size_t kMaxField = 256;

std::string first_hash() {
    return std::string(64, '0');
}

/// Every field with its length before it, so that no two entries give the same bytes.
std::string hash_of(const std::string& before, std::int64_t sequence, const AuditEntry& entry) {
    Sha256 hash;
    const auto add = [&hash](std::string_view field) {
        hash.add(std::to_string(field.size()) + ":");
        hash.add(field);
    };
    add(before);
    add(std::to_string(sequence));
    add(std::to_string(entry.time.time_since_epoch().count()));
    for (const std::string* field : {&entry.tenant, &entry.actor, &entry.peer, &entry.action,
                                     &entry.subject, &entry.outcome}) {
        add(*field);
    }
    return hash.finish();
}

AuditRecord record_of(const sqlite::Statement& row) {
    return {row.integer(0),
            {Time(std::chrono::microseconds(row.integer(1))), row.text(2), row.text(3), row.text(4),
             row.text(5), row.text(6), row.text(7)},
            row.text(8)};
}

}  // namespace

AuditLog::AuditLog(const std::filesystem::path& data_dir)
    : connection_(open_access_database(data_dir)) {}

void AuditLog::append(AuditEntry entry) {
    for (std::string* field : {&entry.tenant, &entry.actor, &entry.peer, &entry.action,
                               &entry.subject, &entry.outcome}) {
        field->resize(std::min(field->size(), kMaxField));
    }
    std::unique_lock lock(mutex_);
    const std::shared_ptr<Batch> batch = open_;
    batch->entries.push_back(std::move(entry));
    written_.wait(lock, [&] { return batch->is_done || !is_writing_; });
    if (!batch->is_done) {  // Nobody writes: this thread does, for all that came meanwhile.
        is_writing_ = true;
        open_ = std::make_shared<Batch>();
        lock.unlock();
        try {
            write(batch->entries);
        } catch (...) {
            batch->error = std::current_exception();
        }
        lock.lock();
        is_writing_ = false;
        batch->is_done = true;
        written_.notify_all();
    }
    if (batch->error) {
        std::rethrow_exception(batch->error);
    }
}

void AuditLog::write(const std::vector<AuditEntry>& entries) {
    const std::scoped_lock lock(connection_mutex_);
    sqlite::Transaction transaction(connection_);
    std::int64_t sequence = 0;
    std::string hash = first_hash();
    {
        sqlite::Statement last(connection_,
                               "SELECT sequence, hash FROM audit ORDER BY sequence DESC LIMIT 1");
        if (last.next()) {
            sequence = last.integer(0);
            hash = last.text(1);
        }
    }
    for (const AuditEntry& entry : entries) {
        hash = hash_of(hash, ++sequence, entry);
        sqlite::Statement statement(connection_,
                                    "INSERT INTO audit VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
        statement.bind(sequence)
            .bind(std::int64_t{entry.time.time_since_epoch().count()})
            .bind(entry.tenant)
            .bind(entry.actor)
            .bind(entry.peer)
            .bind(entry.action)
            .bind(entry.subject)
            .bind(entry.outcome)
            .bind(hash);
        statement.run();
    }
    transaction.commit();
}

void AuditLog::for_each(const std::function<void(const AuditRecord&)>& visit) {
    const std::scoped_lock lock(connection_mutex_);
    sqlite::Statement row(connection_,
                          "SELECT sequence, time, tenant, actor, peer, action, subject, outcome, "
                          "hash FROM audit ORDER BY sequence");
    while (row.next()) {
        visit(record_of(row));
    }
}

AuditVerdict AuditLog::verify(std::int64_t known_sequence, const std::string& known_head) {
    AuditVerdict verdict{0, first_hash(), {}};
    for_each([&](const AuditRecord& record) {
        if (!verdict.trouble.empty()) {
            return;
        }
        const std::string place = "entry " + std::to_string(record.sequence);
        if (record.sequence != verdict.entries + 1) {
            verdict.trouble = place + " follows entry " + std::to_string(verdict.entries) +
                              ": what was between them is gone";
        } else if (record.hash != hash_of(verdict.head, record.sequence, record.entry)) {
            verdict.trouble = place + " doesn't have its hash: it or the one before it was changed";
        } else if (record.sequence == known_sequence && record.hash != known_head) {
            verdict.trouble = place + " doesn't have the known hash: the log was written anew";
        } else {
            verdict.entries = record.sequence;
            verdict.head = record.hash;
        }
    });
    if (verdict.trouble.empty() && known_sequence > verdict.entries) {
        verdict.trouble = "the log ends at entry " + std::to_string(verdict.entries) +
                          " but once had " + std::to_string(known_sequence) +
                          ": its end was cut off";
    }
    return verdict;
}

}  // namespace remesh
