#pragma once

#include <grpcpp/support/server_callback.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "remesh/v1/artifact.pb.h"
#include "server/auth/gate.h"
#include "server/executor.h"
#include "server/partial_uploads.h"
#include "server/store/artifact_store.h"
#include "server/tenant_slots.h"

namespace remesh {

/// Of uploads and downloads alike.
inline constexpr std::size_t kMaxChunkBytes = std::size_t{1} << 20U;

struct TransferOptions {
    int max_transfers = 1'024;          ///< More uploads and downloads at a time are refused.
    int max_transfers_of_tenant = 256;  ///< More of one tenant, too.
};

/// What the streams of artifacts work with.
struct TransferRoom {
    Gate& gate;
    ArtifactStore& artifacts;
    PartialUploads& uploads;
    Executor& executor;
    std::int64_t max_bytes;                        ///< Of one upload.
    std::optional<std::int64_t> max_tenant_bytes;  ///< Unless a tenant's policy says more.
    std::function<bool()> is_draining;
    /// Each stream holds a chunk or two for as long as its caller likes.
    std::shared_ptr<TenantSlots> slots;
};

// Each stream has one chunk in flight, does its disk work on the executor and deletes itself when
// the call is over. `room` must outlive it.

[[nodiscard]] grpc::ServerReadReactor<v1::UploadArtifactRequest>* new_upload(
    const TransferRoom& room, const grpc::CallbackServerContext& context,
    v1::UploadArtifactResponse& reply);
/// Copies the request.
[[nodiscard]] grpc::ServerWriteReactor<v1::DownloadArtifactResponse>* new_download(
    const TransferRoom& room, const grpc::CallbackServerContext& context,
    const v1::DownloadArtifactRequest& request);

}  // namespace remesh
