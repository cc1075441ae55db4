#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "client/connection.h"
#include "client/pending_file.h"
#include "client/unique_fd.h"

namespace remesh::client {

/// One file to send, read twice: once for its digest, once for its bytes.
///
/// Stdin and pipes are copied to an unnamed temporary file first, since their digest has to go
/// before their bytes.
class InputFile {
public:
    /// \param path  a file, or "-" for stdin
    /// \throws Failure{BadInput} if it can't be read
    explicit InputFile(const std::filesystem::path& path);

    [[nodiscard]] const v1::Digest& digest() const { return digest_; }
    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// Last part of the path; empty for stdin.
    [[nodiscard]] std::string name() const;
    /// Fills `buffer` from `offset`; returns how many bytes there were.
    [[nodiscard]] std::size_t read_at(std::int64_t offset, std::span<char> buffer) const;

private:
    void spool();
    void compute_digest();

    std::filesystem::path path_;
    UniqueFd fd_;
    v1::Digest digest_;
};

/// Sends a file, unless the server has its bytes already.
void upload(Connection& connection, const InputFile& file);

/// Fetches an artifact, verifies its digest and leaves it ready to commit; goes on where a broken
/// connection stopped.
///
/// \throws Failure{JobFailed} if the bytes don't have the digest
[[nodiscard]] PendingFile download(Connection& connection, const v1::Digest& digest,
                                   const std::filesystem::path& target);

}  // namespace remesh::client
