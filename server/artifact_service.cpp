#include "server/artifact_service.h"

#include <algorithm>
#include <exception>
#include <optional>
#include <utility>

#include "server/convert.h"
#include "server/store/digest.h"

namespace remesh {
namespace {

[[noreturn]] void refuse(const std::string& field, const std::string& message) {
    throw JobError({FieldProblem{field, field + " " + message}});
}

/// One upload. The executor runs at most one of its steps at a time, so it needs no lock.
class Upload final : public grpc::ServerReadReactor<v1::UploadArtifactRequest> {
public:
    Upload(ArtifactStore& artifacts, Executor& executor, std::int64_t max_bytes,
           std::optional<std::int64_t> max_tenant_bytes, v1::UploadArtifactResponse& reply)
        : artifacts_(artifacts),
          executor_(executor),
          max_bytes_(max_bytes),
          max_tenant_bytes_(max_tenant_bytes),
          reply_(reply) {
        StartRead(&chunk_);
    }

    void OnReadDone(bool ok) override {
        executor_.post([this, ok] {
            try {
                if (ok && take_chunk()) {
                    StartRead(&chunk_);
                    return;
                }
                if (!ok) {
                    complete();
                }
                Finish(grpc::Status::OK);
            } catch (...) {
                Finish(to_status(std::current_exception()));
            }
        });
    }
    void OnDone() override { delete this; }

private:
    /// \return false if no more is needed
    bool take_chunk() {
        if (!draft_) {
            open();
            if (reply_.already_present()) {
                return false;
            }
        }
        if (chunk_.data().size() > kMaxChunkBytes) {
            refuse("data",
                   "must be at most 1 MiB, got " + std::to_string(chunk_.data().size()) + " bytes");
        }
        if (chunk_.offset() != draft_->size()) {
            refuse("offset", "must be " + std::to_string(draft_->size()) +
                                 ", the bytes sent so far, got " + std::to_string(chunk_.offset()));
        }
        const auto size = draft_->size() + static_cast<std::int64_t>(chunk_.data().size());
        if (size > expected_.size) {
            refuse("data", "must not pass the " + std::to_string(expected_.size) +
                               " bytes that were announced");
        }
        draft_->write(chunk_.data());
        return true;
    }

    void open() {
        expected_ = {chunk_.digest().sha256(), chunk_.digest().size_bytes()};
        if (!is_sha256(expected_.sha256)) {
            refuse("digest.sha256", "must be 64 lower-case hexadecimal digits");
        }
        if (expected_.size < 0) {
            refuse("digest.size_bytes", "must be >= 0, got " + std::to_string(expected_.size));
        }
        if (expected_.size > max_bytes_) {
            throw JobError(JobErrorCode::LimitPassed,
                           "an artifact has at most " + std::to_string(max_bytes_) +
                               " bytes here, got " + std::to_string(expected_.size),
                           "artifact");
        }
        if (const auto known = artifacts_.find(tenant_, expected_.sha256)) {
            answer(*known, true);
            return;
        }
        draft_.emplace(artifacts_.draft(tenant_));
    }

    void complete() {
        if (!draft_) {
            refuse("digest", "must come in the first message, got none");
        }
        const ArtifactId artifact = draft_->finish();
        if (artifact != expected_) {
            refuse("digest", "must be that of the bytes: " + std::to_string(artifact.size) +
                                 " bytes with SHA-256 " + artifact.sha256 + " came");
        }
        if (!artifacts_.add(std::move(*draft_), system_now(), max_tenant_bytes_)) {
            throw JobError(JobErrorCode::LimitPassed,
                           "the tenant may keep no more bytes; delete jobs that aren't needed",
                           "tenants/" + tenant_ + "/bytes");
        }
        answer(artifact, false);
    }

    void answer(const ArtifactId& artifact, bool is_present) {
        reply_.mutable_digest()->set_sha256(artifact.sha256);
        reply_.mutable_digest()->set_size_bytes(artifact.size);
        reply_.set_already_present(is_present);
    }

    ArtifactStore& artifacts_;
    Executor& executor_;
    const std::int64_t max_bytes_;
    const std::optional<std::int64_t> max_tenant_bytes_;
    v1::UploadArtifactResponse& reply_;
    const std::string tenant_{kDefaultTenant};
    v1::UploadArtifactRequest chunk_;
    ArtifactId expected_;
    std::optional<ArtifactDraft> draft_;
};

/// One download. A whole one is checked against its digest on the way.
class Download final : public grpc::ServerWriteReactor<v1::DownloadArtifactResponse> {
public:
    Download(ArtifactStore& artifacts, Executor& executor,
             const v1::DownloadArtifactRequest& request)
        : executor_(executor) {
        executor_.post([this, &artifacts, request] {
            try {
                open(artifacts, request);
            } catch (...) {
                Finish(to_status(std::current_exception()));
            }
        });
    }

    void OnWriteDone(bool ok) override {
        executor_.post([this, ok] {
            if (!ok) {
                Finish({grpc::StatusCode::CANCELLED, "the client left"});
            } else if (next_ == end_) {
                Finish(check());
            } else {
                send();
            }
        });
    }
    void OnDone() override { delete this; }

private:
    void open(ArtifactStore& artifacts, const v1::DownloadArtifactRequest& request) {
        if (!is_sha256(request.sha256())) {
            refuse("sha256", "must be 64 lower-case hexadecimal digits");
        }
        if (request.offset() < 0 || request.limit() < 0) {
            refuse(request.offset() < 0 ? "offset" : "limit", "must be >= 0");
        }
        const auto artifact = artifacts.find(std::string(kDefaultTenant), request.sha256());
        if (!artifact) {
            Finish(artifact_not_found_status(request.sha256()));
            return;
        }
        if (request.offset() > artifact->size) {
            Finish({grpc::StatusCode::OUT_OF_RANGE, "offset must be at most " +
                                                        std::to_string(artifact->size) + ", got " +
                                                        std::to_string(request.offset())});
            return;
        }
        view_.emplace(artifacts.open(std::string(kDefaultTenant), *artifact));
        next_ = static_cast<std::size_t>(request.offset());
        end_ = static_cast<std::size_t>(artifact->size);
        if (request.limit() > 0) {
            end_ = std::min(end_, next_ + static_cast<std::size_t>(request.limit()));
        }
        if (next_ == 0 && end_ == view_->bytes().size()) {
            hash_.emplace();
            sha256_ = artifact->sha256;
        }
        total_ = artifact->size;
        send();
    }

    void send() {
        const std::size_t size = std::min(kMaxChunkBytes, end_ - next_);
        const std::string_view bytes = view_->bytes().substr(next_, size);
        if (hash_) {
            hash_->add(bytes);
        }
        // A chunk may still be waiting to be serialized when StartWrite returns: it isn't touched
        // before OnWriteDone.
        if (std::exchange(is_first_, false)) {
            chunk_.set_total_size_bytes(total_);
        } else {
            chunk_.clear_total_size_bytes();
        }
        chunk_.set_offset(static_cast<std::int64_t>(next_));
        chunk_.set_data(bytes.data(), bytes.size());
        next_ += size;
        StartWrite(&chunk_);
    }

    grpc::Status check() {
        if (hash_ && hash_->finish() != sha256_) {
            return {grpc::StatusCode::DATA_LOSS, "the stored bytes no longer have their digest"};
        }
        return grpc::Status::OK;
    }

    Executor& executor_;
    std::optional<ArtifactView> view_;
    std::optional<Sha256> hash_;
    std::string sha256_;
    std::int64_t total_ = 0;
    bool is_first_ = true;
    std::size_t next_ = 0;
    std::size_t end_ = 0;
    v1::DownloadArtifactResponse chunk_;
};

class RefusedUpload final : public grpc::ServerReadReactor<v1::UploadArtifactRequest> {
public:
    explicit RefusedUpload(const grpc::Status& status) { Finish(status); }
    void OnDone() override { delete this; }
};

}  // namespace

ArtifactService::ArtifactService(ArtifactStore& artifacts, Executor& executor,
                                 std::int64_t max_artifact_bytes,
                                 std::optional<std::int64_t> max_tenant_bytes,
                                 IsDraining is_draining)
    : artifacts_(artifacts),
      executor_(executor),
      max_artifact_bytes_(max_artifact_bytes),
      max_tenant_bytes_(max_tenant_bytes),
      is_draining_(std::move(is_draining)) {}

grpc::ServerReadReactor<v1::UploadArtifactRequest>* ArtifactService::UploadArtifact(
    grpc::CallbackServerContext*, v1::UploadArtifactResponse* reply) {
    if (is_draining_()) {
        return new RefusedUpload(shutting_down_status());
    }
    return new Upload(artifacts_, executor_, max_artifact_bytes_, max_tenant_bytes_, *reply);
}

grpc::ServerWriteReactor<v1::DownloadArtifactResponse>* ArtifactService::DownloadArtifact(
    grpc::CallbackServerContext*, const v1::DownloadArtifactRequest* request) {
    return new Download(artifacts_, executor_, *request);
}

}  // namespace remesh
