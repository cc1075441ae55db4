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

constexpr std::size_t kChunkBytes = 1024 * 1024;

constexpr Connection::Milliseconds kQuestionLimit = std::chrono::seconds(10);

/// A line slower than 100 kB/s for a whole transfer counts as broken.
Connection::Milliseconds transfer_limit(std::int64_t bytes) {
    return std::chrono::seconds(60) + Connection::Milliseconds(bytes / 100);
}

Failure cannot_read(const fs::path& path) {
    const Failure reason = system_failure(fmt::format("can't read {}", path.string()));
    return {ExitCode::BadInput, reason.what()};
}

/// Where an upload that broke goes on; 0 if the server can't tell.
std::int64_t committed(Connection& connection, const InputFile& file) {
    grpc::ClientContext context;
    connection.prepare(context, kQuestionLimit);
    v1::GetUploadRequest request;
    *request.mutable_digest() = file.digest();
    v1::Upload upload;
    const grpc::Status status = connection.stubs().artifacts.GetUpload(&context, request, &upload);
    const bool is_usable = status.ok() && upload.committed_bytes() >= 0 &&
                           upload.committed_bytes() < file.digest().size_bytes();
    return is_usable ? upload.committed_bytes() : 0;
}

/// Sends the bytes from an offset on.
grpc::Status send(Connection& connection, grpc::ClientContext& context, const InputFile& file,
                  std::int64_t from) {
    std::vector<char> buffer(kChunkBytes);
    v1::UploadArtifactResponse response;
    const auto stream = connection.stubs().artifacts.UploadArtifact(&context, &response);
    v1::UploadArtifactRequest chunk;
    *chunk.mutable_digest() = file.digest();
    std::int64_t sent = from;
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
    } while (is_open && sent < file.digest().size_bytes());
    if (is_open) {
        stream->WritesDone();
    }
    return stream->Finish();
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
    bool is_first = true;
    connection.retry(transfer_limit(file.digest().size_bytes()), [&](grpc::ClientContext& context) {
        const bool is_resumed = !std::exchange(is_first, false);
        const std::int64_t from = is_resumed ? committed(connection, file) : 0;
        const grpc::Status status = send(connection, context, file, from);
        // Somebody else moved the upload meanwhile: ask again where it stands.
        return status.error_code() == grpc::StatusCode::OUT_OF_RANGE
                   ? grpc::Status(grpc::StatusCode::UNAVAILABLE, status.error_message())
                   : status;
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
