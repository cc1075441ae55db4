#pragma once

#include "remesh/v1/artifact.grpc.pb.h"
#include "server/inspect.h"
#include "server/reception.h"
#include "server/transfer_streams.h"

namespace remesh {

/// Bytes in and out, and what they are. The tenant is the caller's.
class ArtifactService final : public v1::ArtifactService::CallbackService {
public:
    ArtifactService(TransferRoom room, Inspector inspector, Reception& reception);

    grpc::ServerUnaryReactor* FindMissingArtifacts(
        grpc::CallbackServerContext* context, const v1::FindMissingArtifactsRequest* request,
        v1::FindMissingArtifactsResponse* reply) override;
    grpc::ServerReadReactor<v1::UploadArtifactRequest>* UploadArtifact(
        grpc::CallbackServerContext* context, v1::UploadArtifactResponse* reply) override;
    grpc::ServerUnaryReactor* GetUpload(grpc::CallbackServerContext* context,
                                        const v1::GetUploadRequest* request,
                                        v1::Upload* reply) override;
    grpc::ServerWriteReactor<v1::DownloadArtifactResponse>* DownloadArtifact(
        grpc::CallbackServerContext* context, const v1::DownloadArtifactRequest* request) override;
    grpc::ServerUnaryReactor* InspectArtifact(grpc::CallbackServerContext* context,
                                              const v1::InspectArtifactRequest* request,
                                              v1::Inspection* reply) override;

private:
    v1::Inspection inspect(const std::string& tenant, const v1::InspectArtifactRequest& request);

    const TransferRoom room_;
    const Inspector inspector_;
    Reception& reception_;
};

}  // namespace remesh
