#include "client/transfer.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <unistd.h>
#include <utility>
#include <vector>

#include "client/failure.h"
#include "client/sha256.h"
#include "client/stubs.h"
#include "client/text.h"

namespace remesh::client {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kChunkBytes = 512 * 1024;

/// A line slower than 100 kB/s for a whole transfer counts as broken.
Connection::Milliseconds transfer_limit(std::int64_t bytes) {
    return std::chrono::seconds(60) + Connection::Milliseconds(bytes / 100);
}

Failure cannot_read(const fs::path& path) {
    const Failure reason = system_failure(fmt::format("can't read {}", path.string()));
    return {ExitCode::BadInput, reason.what()};
}

}  // namespace

InputFile::InputFile(const fs::path& path) : path_(path) {
    fd_.reset(path == "-" ? dup(STDIN_FILENO) : open(path.c_str(), O_RDONLY | O_CLOEXEC));
    struct stat info {};
    if (!fd_.is_open() || fstat(fd_.get(), &info) != 0) {
        throw cannot_read(path);
    }
    if (S_ISDIR(info.st_mode)) {
        throw Failure(ExitCode::BadInput,
                      fmt::format("can't read {}: it is a folder", path.string()));
    }
    if (!S_ISREG(info.st_mode)) {
        spool();
    }
    compute_digest();
}

std::string InputFile::name() const {
    return path_ == "-" ? "" : path_.filename().string();
}

void InputFile::spool() {
    UniqueFd copy = open_unnamed_file();
    std::vector<char> buffer(kChunkBytes);
    ssize_t got = 0;
    while ((got = read(fd_.get(), buffer.data(), buffer.size())) > 0) {
        write_fully(copy.get(), {buffer.data(), static_cast<std::size_t>(got)}, "temporary file");
    }
    if (got < 0) {
        throw cannot_read(path_);
    }
    fd_ = std::move(copy);
}

void InputFile::compute_digest() {
    Sha256 sha;
    std::vector<char> buffer(kChunkBytes);
    std::int64_t size = 0;
    while (const std::size_t got = read_at(size, buffer)) {
        sha.update({buffer.data(), got});
        size += static_cast<std::int64_t>(got);
    }
    digest_.set_sha256(sha.finish());
    digest_.set_size_bytes(size);
}

std::size_t InputFile::read_at(std::int64_t offset, std::span<char> buffer) const {
    while (true) {
        const ssize_t got = pread(fd_.get(), buffer.data(), buffer.size(), offset);
        if (got >= 0) {
            return static_cast<std::size_t>(got);
        }
        if (errno != EINTR) {
            throw cannot_read(path_);
        }
    }
}

void upload(Connection& connection, const InputFile& file) {
    std::vector<char> buffer(kChunkBytes);
    const std::int64_t size = file.digest().size_bytes();

    connection.retry(transfer_limit(size), [&](grpc::ClientContext& context) {
        v1::UploadArtifactResponse response;
        const auto stream = connection.stubs().artifacts.UploadArtifact(&context, &response);
        v1::UploadArtifactRequest chunk;
        *chunk.mutable_digest() = file.digest();
        std::int64_t sent = 0;
        bool is_open = true;
        do {
            const std::size_t got = file.read_at(sent, buffer);
            chunk.set_offset(sent);
            chunk.set_data(buffer.data(), got);
            is_open = stream->Write(chunk);  // False when the server has already answered.
            chunk.clear_digest();
            sent += static_cast<std::int64_t>(got);
            if (got == 0) {
                break;
            }
        } while (is_open && sent < size);
        if (is_open) {
            stream->WritesDone();
        }
        return stream->Finish();
    });
}

PendingFile download(Connection& connection, const v1::Digest& digest, const fs::path& target) {
    PendingFile file(target);
    Sha256 sha;
    v1::DownloadArtifactRequest request;
    request.set_sha256(digest.sha256());
    const std::int64_t size = digest.size_bytes();

    connection.retry(transfer_limit(size), [&](grpc::ClientContext& context) {
        const auto stream = connection.stubs().artifacts.DownloadArtifact(&context, request);
        v1::DownloadArtifactResponse chunk;
        while (request.offset() < size && stream->Read(&chunk)) {
            connection.note_contact();
            if (chunk.offset() != request.offset()) {
                return grpc::Status(grpc::StatusCode::DATA_LOSS,
                                    "the server sent bytes out of order");
            }
            file.write(chunk.data());
            sha.update(chunk.data());
            request.set_offset(request.offset() + static_cast<std::int64_t>(chunk.data().size()));
        }
        while (stream->Read(&chunk)) {
        }
        const grpc::Status status = stream->Finish();
        return status.ok() && request.offset() < size
                   ? grpc::Status(grpc::StatusCode::UNAVAILABLE, "the download ended too early")
                   : status;
    });
    if (request.offset() != size || sha.finish() != digest.sha256()) {
        throw Failure(ExitCode::JobFailed,
                      fmt::format("the bytes that came for {} don't have the digest {}: nothing "
                                  "was written",
                                  target.string(), sanitised(digest.sha256())));
    }
    return file;
}

}  // namespace remesh::client
