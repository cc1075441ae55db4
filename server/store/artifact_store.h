#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
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

/// The file of an artifact, open for reading.
class ArtifactFile {
public:
    ArtifactFile(ArtifactFile&& other) noexcept;
    ArtifactFile& operator=(ArtifactFile&&) = delete;
    ~ArtifactFile();

    /// Reads so many bytes from `offset`.
    /// \throws StoreError if the disk doesn't give them, or {Lost} if there aren't as many
    void read(std::int64_t offset, std::size_t size, std::string& bytes) const;

private:
    friend class ArtifactStore;
    ArtifactFile(std::string sha256, int file) : sha256_(std::move(sha256)), file_(file) {}

    std::string sha256_;
    int file_;
};

/// Bytes of an artifact, mapped for reading. A disk that doesn't give them ends the process, so
/// this is for those who may end.
class ArtifactView {
public:
    ArtifactView(ArtifactView&& other) noexcept;
    ArtifactView& operator=(ArtifactView&&) = delete;
    ~ArtifactView();

    [[nodiscard]] std::string_view bytes() const { return bytes_; }

private:
    friend class ArtifactStore;
    ArtifactView(ArtifactFile file, std::string_view bytes)
        : file_(std::move(file)), bytes_(bytes) {}

    ArtifactFile file_;
    std::string_view bytes_;
};

/// The bytes of artifacts: files of mode 0600 under `tenants/{tenant}/artifacts`, named by their
/// SHA-256, so that equal bytes of a tenant are one file. Which of them exist is what JobStore
/// says.
///
/// A file is written beside its place, synced and renamed: no half file is ever visible, and one
/// that was damaged is replaced as a whole. All calls may come from any thread, and from any
/// process that uses the data directory.
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
    /// The same if its file is there, too, and as long as it should be.
    [[nodiscard]] std::optional<ArtifactId> find_whole(const std::string& tenant,
                                                       const std::string& sha256) const;
    /// \throws StoreError{Lost} if the file is gone or not as long as it should be
    [[nodiscard]] ArtifactFile open_file(const std::string& tenant,
                                         const ArtifactId& artifact) const;
    /// \copydoc open_file
    [[nodiscard]] ArtifactView open(const std::string& tenant, const ArtifactId& artifact) const;

    /// Puts away a file that doesn't have its digest any more, if it is still the artifact's: the
    /// artifact isn't whole from then on, until it is published again. It is kept as
    /// `.damaged-{sha256}` until then.
    void set_aside(const std::string& tenant, const ArtifactFile& file);
    /// Reads all bytes of an artifact; sets it aside if they don't have their digest.
    /// \param checkpoint  called every few MiB
    /// \throws StoreError{Lost} then
    void require_whole(const std::string& tenant, const ArtifactView& view,
                       const std::function<void()>& checkpoint);

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
    [[nodiscard]] std::filesystem::path damaged_path_of(const std::string& tenant,
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
