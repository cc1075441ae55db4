#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/store/job_store.h"
#include "server/store/sqlite.h"

namespace remesh {

/// Who did what. Ids and digests only: no names of files, no labels, no geometry.
struct AuditEntry {
    Time time{};
    std::string tenant{};
    std::string actor{};    ///< "token:ID", "certificate:ID", "anonymous" or "operator:UID".
    std::string peer{};     ///< Where it came from, e.g. "ipv4:10.0.0.7:51234"; may be empty.
    std::string action{};   ///< E.g. "CreateJob".
    std::string subject{};  ///< A job's id, a digest, a credential's id; may be empty.
    std::string outcome{};  ///< "OK" or the name of a status.
};

/// An entry in its place in the chain.
struct AuditRecord {
    std::int64_t sequence = 0;  ///< From 1, without gaps.
    AuditEntry entry{};
    std::string hash{};  ///< SHA-256 of the hash before it and of all fields.
};

struct AuditVerdict {
    std::int64_t entries = 0;
    std::string head{};     ///< Hash of the last entry; 64 zeros if there is none.
    std::string trouble{};  ///< Where the chain breaks, and how; empty if it doesn't.
};

/// A log that only grows. Each entry carries the hash of the one before it, so that none can be
/// changed, left out or put in without all later hashes changing; whoever keeps a head apart from
/// the log can tell if its end was cut off or written anew.
/// All calls may come from any thread, and from several processes.
class AuditLog {
public:
    explicit AuditLog(const std::filesystem::path& data_dir);

    /// On the disk when it returns; entries of several threads share one sync.
    /// \throws StoreError if it couldn't be written
    void append(AuditEntry entry);
    /// Calls `visit` with every entry, oldest first.
    void for_each(const std::function<void(const AuditRecord&)>& visit);
    /// Recomputes the whole chain.
    /// \param known_sequence, known_head  what a head was at some time; 0: not known
    [[nodiscard]] AuditVerdict verify(std::int64_t known_sequence = 0,
                                      const std::string& known_head = {});

private:
    struct Batch {
        std::vector<AuditEntry> entries{};
        bool is_done = false;
        std::exception_ptr error{};
    };

    void write(const std::vector<AuditEntry>& entries);

    std::mutex mutex_;
    std::condition_variable written_;
    std::shared_ptr<Batch> open_ = std::make_shared<Batch>();  // needs mutex_
    bool is_writing_ = false;                                  // needs mutex_

    std::mutex connection_mutex_;
    sqlite::Connection connection_;  // needs connection_mutex_
};

}  // namespace remesh
