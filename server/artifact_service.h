#pragma once

#include <cstddef>
#include <functional>
#include <optional>

#include "remesh/v1/artifact.grpc.pb.h"
#include "server/executor.h"
#include "server/store/artifact_store.h"

namespace remesh {

/// Of uploads and downloads alike.
inline constexpr std::size_t kMaxChunkBytes = std::size_t{1} << 20U;

/// Bytes in and out. Each stream has one chunk in flight and does its disk work on the executor.
class ArtifactService final : public v1::ArtifactService::CallbackService {
public:
    using IsDraining = std::function<bool()>;

    ArtifactService(ArtifactStore& artifacts, Executor& executor, std::int64_t max_artifact_bytes,
                    std::optional<std::int64_t> max_tenant_bytes, IsDraining is_draining);

    grpc::ServerReadReactor<v1::UploadArtifactRequest>* UploadArtifact(
        grpc::CallbackServerContext* context, v1::UploadArtifactResponse* reply) override;
    grpc::ServerWriteReactor<v1::DownloadArtifactResponse>* DownloadArtifact(
        grpc::CallbackServerContext* context, const v1::DownloadArtifactRequest* request) override;

private:
    ArtifactStore& artifacts_;
    Executor& executor_;
    const std::int64_t max_artifact_bytes_;
    const std::optional<std::int64_t> max_tenant_bytes_;  ///< Unless a tenant's policy says more.
    const IsDraining is_draining_;
};

}  // namespace remesh
