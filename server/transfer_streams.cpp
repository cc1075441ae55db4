#include "server/transfer_streams.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "server/call.h"
#include "server/convert.h"
#include "server/open_stream.h"
#include "server/store/digest.h"

namespace remesh {
namespace {

constexpr Rule kUpload{"UploadArtifact", Role::User, true};
constexpr Rule kDownload{"DownloadArtifact", Role::Viewer, true};

// Of a tenant, those that rest and those that streams are at.
constexpr int kMaxUploads = 1'000;
// Downloads share so much memory for chunks, as far as their size allows it.
constexpr std::size_t kBufferBytes = std::size_t{64} << 20U;
constexpr std::size_t kMinChunkBytes = std::size_t{64} << 10U;

/// What a download sends at a time when there are so many transfers.
std::size_t chunk_bytes(std::int64_t transfers) {
    return std::clamp(kBufferBytes / static_cast<std::size_t>(std::max<std::int64_t>(1, transfers)),
                      kMinChunkBytes, kMaxChunkBytes);
}

/// Asked with every chunk: a credential may end while a caller takes its time.
grpc::Status may_go_on(Gate& gate, const Principal& who) {
    try {
        return gate.is_still_valid(who) ? grpc::Status::OK : credential_ended_status();
    } catch (...) {
        return to_status(std::current_exception());
    }
}

/// One upload. The executor runs at most one of its steps at a time, so it needs no lock.
class Upload final : public grpc::ServerReadReactor<v1::UploadArtifactRequest> {
public:
    Upload(const TransferRoom& room, const grpc::CallbackServerContext& context,
           v1::UploadArtifactResponse& reply)
        : room_(room), context_(context), reply_(reply) {
        room_.executor.post([this] {
            // What was uploaded is written down at the end.
            constexpr Rule kOnlyAdmit{kUpload.action, kUpload.least, false};
            const grpc::Status status = guarded(room_.gate, context_, kOnlyAdmit,
                                                [this](const Principal& who, std::string&) {
                                                    who_ = who;
                                                    slot_ = room_.slots->take(who.tenant);
                                                });
            if (!status.ok()) {
                Finish(status);
            } else if (room_.is_draining()) {
                Finish(shutting_down_status());
            } else {
                StartRead(&chunk_);
            }
        });
    }

    void OnReadDone(bool ok) override {
        room_.executor.post([this, ok] {
            grpc::Status status;
            try {
                if (ok && take_chunk()) {
                    StartRead(&chunk_);
                    return;
                }
                if (!ok && context_.IsCancelled()) {
                    status = {grpc::StatusCode::CANCELLED, "the client left"};
                } else if (!ok) {
                    complete();
                }
            } catch (...) {
                status = to_status(std::current_exception());
            }
            end(status);
        });
    }
    void OnDone() override { delete this; }

private:
    /// \return false if no more is needed
    bool take_chunk() {
        if (const grpc::Status status = may_go_on(room_.gate, who_); !status.ok()) {
            throw StatusError(status);
        }
        if (!upload_) {
            open();
            if (reply_.already_present()) {
                return false;
            }
        }
        if (chunk_.data().size() > kMaxChunkBytes) {
            refuse("data",
                   "must be at most 1 MiB, got " + std::to_string(chunk_.data().size()) + " bytes");
        }
        if (chunk_.offset() != upload_->size()) {
            refuse("offset", "must be " + std::to_string(upload_->size()) +
                                 ", where the last chunk ended, got " +
                                 std::to_string(chunk_.offset()));
        }
        const auto size = upload_->size() + static_cast<std::int64_t>(chunk_.data().size());
        if (size > expected_.size) {
            refuse("data", "must not pass the " + std::to_string(expected_.size) +
                               " bytes that were announced");
        }
        room_.uploads.require_disk(expected_.size - upload_->size());
        upload_->write(chunk_.data());
        chunk_ = {};  // A caller that pauses holds no memory.
        return true;
    }

    void open() {
        expected_ = artifact_of(chunk_.digest(), "digest");
        if (expected_.size > room_.max_bytes) {
            throw JobError(JobErrorCode::LimitPassed,
                           "an artifact has at most " + std::to_string(room_.max_bytes) +
                               " bytes here, got " + std::to_string(expected_.size),
                           "artifact");
        }
        if (chunk_.offset() < 0) {
            refuse("offset", "must be >= 0, got " + std::to_string(chunk_.offset()));
        }
        if (const auto known = room_.artifacts.find_whole(who_.tenant, expected_.sha256)) {
            answer(*known, true);
            return;
        }
        if (chunk_.offset() == 0 && room_.uploads.count(who_.tenant) >= kMaxUploads) {
            throw JobError(JobErrorCode::LimitPassed,
                           "a tenant has at most " + std::to_string(kMaxUploads) +
                               " unfinished uploads; finish them, or wait until they are dropped",
                           "tenants/" + who_.tenant + "/uploads");
        }
        auto upload = room_.uploads.open(who_.tenant, expected_, chunk_.offset());
        if (upload && !has_room()) {
            throw tenant_full();
        }
        if (!upload) {
            throw StatusError({grpc::StatusCode::OUT_OF_RANGE,
                               "offset must be where the upload stands; GetUpload tells"});
        }
        room_.uploads.require_disk(expected_.size - upload->size());
        upload_.emplace(std::move(*upload));
    }

    /// Whether the tenant may keep all that it has and is sending.
    [[nodiscard]] bool has_room() const {
        const auto left = room_.artifacts.room_of(who_.tenant, room_.max_tenant_bytes);
        // What replaces a damaged file is counted already.
        const auto known = room_.artifacts.find(who_.tenant, expected_.sha256);
        return !left || room_.uploads.bytes_of(who_.tenant) <= *left + (known ? known->size : 0);
    }
    [[nodiscard]] JobError tenant_full() const {
        return {JobErrorCode::LimitPassed,
                "the tenant may keep no more bytes; delete jobs that aren't needed",
                "tenants/" + who_.tenant + "/bytes"};
    }

    void complete() {
        if (!upload_) {
            refuse("digest", "must come in the first message, got none");
        }
        if (upload_->size() < expected_.size) {
            refuse("data", "must be " + std::to_string(expected_.size) +
                               " bytes in all, as announced; " + std::to_string(upload_->size()) +
                               " came and are kept");
        }
        const ArtifactId artifact = upload_->finish();
        if (artifact != expected_) {
            upload_->discard();
            refuse("digest", "must be that of the bytes: " + std::to_string(artifact.size) +
                                 " bytes with SHA-256 " + artifact.sha256 + " came");
        }
        if (!room_.artifacts.add(room_.artifacts.adopt(who_.tenant, upload_->release(), artifact),
                                 system_now(), room_.max_tenant_bytes)) {
            throw tenant_full();
        }
        answer(artifact, false);
    }

    void answer(const ArtifactId& artifact, bool is_present) {
        reply_.mutable_digest()->set_sha256(artifact.sha256);
        reply_.mutable_digest()->set_size_bytes(artifact.size);
        reply_.set_already_present(is_present);
    }

    void end(grpc::Status status) {
        try {
            room_.gate.record(who_, context_.peer(), kUpload.action, expected_.sha256,
                              code_name(status.error_code()));
        } catch (...) {
            status = to_status(std::current_exception());
        }
        // Before the answer, so that whoever gets it finds them free.
        upload_.reset();
        slot_.reset();
        chunk_ = {};
        Finish(status);
    }

    const TransferRoom& room_;
    const grpc::CallbackServerContext& context_;
    v1::UploadArtifactResponse& reply_;
    Principal who_;
    std::shared_ptr<void> slot_;
    v1::UploadArtifactRequest chunk_;
    ArtifactId expected_;
    std::optional<PartialUpload> upload_;
};

/// One download. A whole one is checked against its digest on the way.
class Download final : public grpc::ServerWriteReactor<v1::DownloadArtifactResponse> {
public:
    Download(const TransferRoom& room, const grpc::CallbackServerContext& context,
             const v1::DownloadArtifactRequest& request)
        : room_(room) {
        room_.executor.post([this, &context, request] {
            const grpc::Status status = guarded(room_.gate, context, kDownload,
                                                [&](const Principal& who, std::string& subject) {
                                                    who_ = who;
                                                    slot_ = room_.slots->take(who.tenant);
                                                    open(who.tenant, request, subject);
                                                });
            if (!status.ok()) {
                end(status);
            } else {
                go_on();
            }
        });
    }

    void OnWriteDone(bool ok) override {
        room_.executor.post([this, ok] {
            if (!ok) {
                end({grpc::StatusCode::CANCELLED, "the client left"});
            } else if (const grpc::Status status = may_go_on(room_.gate, who_);
                       !status.ok() && next_ < end_) {
                end(status);
            } else {
                go_on();
            }
        });
    }
    void OnDone() override { delete this; }

private:
    void open(const std::string& tenant, const v1::DownloadArtifactRequest& request,
              std::string& subject) {
        require_small_request(request.SpaceUsedLong());
        require_sha256(request.sha256(), "sha256");
        subject = request.sha256();
        if (request.offset() < 0 || request.limit() < 0) {
            refuse(request.offset() < 0 ? "offset" : "limit", "must be >= 0");
        }
        const auto artifact = room_.artifacts.find(tenant, request.sha256());
        if (!artifact) {
            throw StatusError(artifact_not_found_status(request.sha256()));
        }
        if (request.offset() > artifact->size) {
            throw StatusError({grpc::StatusCode::OUT_OF_RANGE,
                               "offset must be at most " + std::to_string(artifact->size) +
                                   ", got " + std::to_string(request.offset())});
        }
        file_.emplace(room_.artifacts.open_file(tenant, *artifact));
        next_ = static_cast<std::size_t>(request.offset());
        end_ = static_cast<std::size_t>(artifact->size);
        if (request.limit() > 0) {
            end_ = std::min(
                end_, next_ + static_cast<std::size_t>(std::min(request.limit(), artifact->size)));
        }
        sha256_ = artifact->sha256;
        total_ = artifact->size;
        if (next_ == 0 && end_ == static_cast<std::size_t>(total_)) {
            hash_.emplace();
        }
    }

    /// Sends the next chunk, or ends if there is none; an empty file is a chunk, too.
    void go_on() {
        try {
            if (next_ < end_ || is_first_) {
                send();
                return;
            }
            check();
        } catch (...) {
            end(to_status(std::current_exception()));
            return;
        }
        end(grpc::Status::OK);
    }

    void send() {
        const std::size_t size = std::min(chunk_bytes(room_.slots->taken()), end_ - next_);
        // A chunk may still be waiting to be serialized when StartWrite returns: it isn't touched
        // before OnWriteDone.
        if (std::exchange(is_first_, false)) {
            chunk_.set_total_size_bytes(total_);
        } else {
            chunk_.clear_total_size_bytes();
        }
        chunk_.set_offset(static_cast<std::int64_t>(next_));
        file_->read(static_cast<std::int64_t>(next_), size, *chunk_.mutable_data());
        next_ += size;
        if (hash_) {
            hash_->add(chunk_.data());
        }
        StartWrite(&chunk_);
    }

    void end(const grpc::Status& status) {
        slot_.reset();  // before the answer, as an upload's
        Finish(status);
    }

    void check() {
        if (hash_ && hash_->finish() != sha256_) {
            room_.artifacts.set_aside(who_.tenant, *file_);
            throw StoreError("store: the bytes of artifact " + sha256_ + " are damaged",
                             StoreError::Kind::Lost);
        }
    }

    const TransferRoom& room_;
    Principal who_;
    std::shared_ptr<void> slot_;
    std::optional<ArtifactFile> file_;
    std::optional<Sha256> hash_;
    std::string sha256_;
    std::int64_t total_ = 0;
    bool is_first_ = true;
    std::size_t next_ = 0;
    std::size_t end_ = 0;
    v1::DownloadArtifactResponse chunk_;
};

}  // namespace

grpc::ServerReadReactor<v1::UploadArtifactRequest>* new_upload(
    const TransferRoom& room, const grpc::CallbackServerContext& context,
    v1::UploadArtifactResponse& reply) {
    return new Upload(room, context, reply);
}

grpc::ServerWriteReactor<v1::DownloadArtifactResponse>* new_download(
    const TransferRoom& room, const grpc::CallbackServerContext& context,
    const v1::DownloadArtifactRequest& request) {
    return new Download(room, context, request);
}

}  // namespace remesh
