#pragma once

#include <filesystem>
#include <span>

#include "client/unique_fd.h"

namespace remesh::client {

/// A file that appears whole or not at all.
///
/// Bytes go to a temporary file beside the target; `commit` flushes it to the disk and renames it
/// into place. Without a commit nothing of it stays. What can't be renamed onto (stdout, a pipe, a
/// device) gets its bytes at the commit.
class PendingFile {
public:
    /// \param target  a path, or "-" for stdout
    /// \throws Failure{Local} if nothing can be written there
    explicit PendingFile(const std::filesystem::path& target);
    ~PendingFile();
    PendingFile(PendingFile&& other) noexcept;
    PendingFile(const PendingFile&) = delete;
    PendingFile& operator=(const PendingFile&) = delete;
    PendingFile& operator=(PendingFile&&) = delete;

    void write(std::span<const char> bytes);
    void commit();

private:
    void pour() const;

    std::filesystem::path target_;     ///< Where the bytes shall be, links resolved.
    std::filesystem::path temporary_;  ///< Empty when there is nothing to rename.
    UniqueFd fd_;
};

/// A temporary file without a name: gone when it is closed, whatever happens.
[[nodiscard]] UniqueFd open_unnamed_file();

/// Writes all bytes. \throws Failure{Local} that names `what`
void write_fully(int fd, std::span<const char> bytes, const std::filesystem::path& what);

}  // namespace remesh::client
