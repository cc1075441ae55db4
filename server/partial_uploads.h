#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "server/store/data_dir.h"
#include "server/store/digest.h"
#include "server/store/job_store.h"

namespace remesh {

/// An upload on its way, in a file of its own. For one thread at a time.
class PartialUpload {
public:
    PartialUpload(PartialUpload&& other) noexcept;
    PartialUpload& operator=(PartialUpload&&) = delete;
    /// Keeps what came, so that the upload can go on later, unless it was discarded or is nobody's.
    ~PartialUpload();

    [[nodiscard]] std::int64_t size() const { return size_; }
    /// \throws StoreError if the disk doesn't take it
    void write(std::string_view bytes);
    /// Ends the writing and waits for the disk. \return what came
    ArtifactId finish();
    /// Gives the finished file away; whoever takes it must rename it.
    [[nodiscard]] std::filesystem::path release();
    /// Forgets what came.
    void discard();

private:
    friend class PartialUploads;
    PartialUpload(std::filesystem::path path, int file, bool is_kept);

    void take_up();

    std::filesystem::path path_;
    std::shared_ptr<void> announced_;
    int file_ = -1;
    bool is_kept_;
    std::int64_t size_ = 0;
    Sha256 hash_;
};

/// Uploads that broke and may go on: files of mode 0600 under `tenants/{tenant}/uploads`, named by
/// the digest that they shall have. Locked while a stream is at them.
/// All calls may come from any thread.
class PartialUploads {
public:
    explicit PartialUploads(std::filesystem::path data_dir) : data_dir_(std::move(data_dir)) {}

    /// Goes on with an upload at `offset`, or begins it anew if that is 0. While another stream is
    /// at the same bytes, begins one that isn't kept.
    ///
    /// \param artifact  what it shall be in the end
    /// \return nothing if the upload doesn't stand at `offset`
    /// \throws StoreError
    [[nodiscard]] std::optional<PartialUpload> open(const std::string& tenant,
                                                    const ArtifactId& artifact,
                                                    std::int64_t offset);
    /// Bytes that a tenant's uploads take: what came of those that rest, and all of those that
    /// streams are at.
    [[nodiscard]] std::int64_t bytes_of(const std::string& tenant) const;
    /// \throws StoreError{Full} if so many bytes would leave too little of the disk to work with
    void require_disk(std::int64_t bytes) const { require_room(data_dir_, bytes); }
    /// How many uploads of a tenant there are, those that rest and those that streams are at.
    [[nodiscard]] int count(const std::string& tenant) const;
    /// Where an upload stands: 0 if none is there, or while a stream is at it.
    [[nodiscard]] std::int64_t committed(const std::string& tenant,
                                         const std::string& sha256) const;
    /// Deletes uploads that nobody went on with since `before`.
    void remove_abandoned(Time before) const;

private:
    [[nodiscard]] std::shared_ptr<void> announce(const std::string& tenant, std::int64_t bytes);
    [[nodiscard]] std::filesystem::path directory_of(const std::string& tenant) const;

    std::filesystem::path data_dir_;
    mutable std::mutex mutex_;
    std::map<std::string, std::int64_t> announced_;  // Of a tenant's streams. Needs mutex_.
};

}  // namespace remesh
