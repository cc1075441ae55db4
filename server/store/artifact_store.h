#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/checkpoint_files.h"
#include "server/store/digest.h"
#include "server/store/job_store.h"

namespace remesh {

/// A file being written. Nobody sees it before `ArtifactStore::publish`; deleted if that never
/// comes. Locked as long as its writer lives, so that what a killed one left can be told.
class ArtifactDraft {
public:
    ArtifactDraft(ArtifactDraft&& other) noexcept;
    ArtifactDraft& operator=(ArtifactDraft&&) = delete;
    ~ArtifactDraft();

    /// \throws StoreError if the disk doesn't take it
    void write(std::string_view bytes);
    /// Ends the writing and waits for the disk. \return what was written
    const ArtifactId& finish();
    [[nodiscard]] std::int64_t size() const { return id_.size; }

private:
    friend class ArtifactStore;
    ArtifactDraft(std::string tenant, std::filesystem::path path);
    /// A finished one, of a file that is there.
    ArtifactDraft(std::string tenant, std::filesystem::path path, ArtifactId id);

    std::string tenant_;
    std::filesystem::path path_;
    int file_ = -1;
    ArtifactId id_;
    Sha256 hash_;
};

/// Bytes of an artifact, mapped for reading.
class ArtifactView {
public:
    ArtifactView(ArtifactView&& other) noexcept;
    ArtifactView& operator=(ArtifactView&&) = delete;
    ~ArtifactView();

    [[nodiscard]] std::string_view bytes() const { return bytes_; }

private:
    friend class ArtifactStore;
    explicit ArtifactView(std::string_view bytes) : bytes_(bytes) {}

    std::string_view bytes_;
};

/// The bytes of artifacts: files of mode 0600 under `tenants/{tenant}/artifacts`, named by their
/// SHA-256, so that equal bytes of a tenant are one file. Which of them exist is what JobStore
/// says.
///
/// A file is written beside its place, synced and renamed: no half file is ever visible.
/// All calls may come from any thread, and from any process that uses the data directory.
class ArtifactStore {
public:
    ArtifactStore(std::filesystem::path data_dir, JobStore& store);
    ArtifactStore(const ArtifactStore&) = delete;
    ArtifactStore& operator=(const ArtifactStore&) = delete;
    ~ArtifactStore();

    [[nodiscard]] ArtifactDraft draft(const std::string& tenant);
    /// Makes a finished draft of a file of the data directory that was written and synced
    /// elsewhere, and now is the draft's.
    [[nodiscard]] ArtifactDraft adopt(const std::string& tenant, const std::filesystem::path& file,
                                      const ArtifactId& artifact);
    /// Puts finished drafts in their places and calls `record`, which has to bring them on record
    /// in the JobStore. Files that aren't on record afterwards are deleted again.
    void publish(std::vector<ArtifactDraft> drafts, const std::function<void()>& record);

    /// Publishes and records one finished draft.
    /// \return false if the tenant may keep no more bytes (JobStore::add_artifact)
    bool add(ArtifactDraft draft, Time now, std::optional<std::int64_t> max_bytes = {});

    /// Bytes that a tenant may add by its policy, or else by `max_bytes`; nothing if any number.
    [[nodiscard]] std::optional<std::int64_t> room_of(const std::string& tenant,
                                                      std::optional<std::int64_t> max_bytes) const;

    [[nodiscard]] std::optional<ArtifactId> find(const std::string& tenant,
                                                 const std::string& sha256) const;
    /// \throws StoreError if the file is gone
    [[nodiscard]] ArtifactView open(const std::string& tenant, const ArtifactId& artifact) const;

    /// Deletes those that no job needs any more, record and file.
    void remove_unneeded(const std::string& tenant, const std::vector<std::string>& digests);
    /// Deletes what killed processes left (drafts, files without a record, checkpoints of jobs that
    /// have ended), and artifacts that were added before `before` and that no job needs.
    void collect_garbage(Time before);

    /// Where this directory's unfinished jobs stand.
    [[nodiscard]] const CheckpointFiles& checkpoints() const { return checkpoints_; }

private:
    class Exclusive;
    [[nodiscard]] std::filesystem::path path_of(const std::string& tenant,
                                                const std::string& sha256) const;

    std::filesystem::path data_dir_;
    JobStore& store_;
    CheckpointFiles checkpoints_;
    // Both held while files and their records change together, so that a removal can't take a file
    // from under a record that is just being made: against other threads, and other processes.
    std::mutex mutex_;
    int lock_file_ = -1;
};

}  // namespace remesh
