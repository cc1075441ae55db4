#include "server/artifact_service.h"

#include <utility>

#include "server/call.h"
#include "server/convert.h"

namespace remesh {
namespace {

constexpr Rule kFindMissing{"FindMissingArtifacts", Role::Viewer, false};
constexpr Rule kGetUpload{"GetUpload", Role::User, false};
constexpr Rule kInspect{"InspectArtifact", Role::Viewer, true};

constexpr int kMaxDigests = 1'000;
constexpr std::size_t kMaxFileName = 255;

}  // namespace

ArtifactService::ArtifactService(TransferRoom room, Inspector inspector, Reception& reception)
    : room_(std::move(room)), inspector_(std::move(inspector)), reception_(reception) {}

grpc::ServerUnaryReactor* ArtifactService::FindMissingArtifacts(
    grpc::CallbackServerContext* context, const v1::FindMissingArtifactsRequest* request,
    v1::FindMissingArtifactsResponse* reply) {
    return reception_.answer(
        {context, request, reply}, kFindMissing, [=, this](const Principal& who, std::string&) {
            if (request->digests_size() > kMaxDigests) {
                refuse("digests",
                       "must be at most 1000, got " + std::to_string(request->digests_size()));
            }
            for (int i = 0; i < request->digests_size(); ++i) {
                const v1::Digest& digest = request->digests(i);
                const auto artifact = artifact_of(digest, "digests[" + std::to_string(i) + "]");
                if (!room_.artifacts.find_whole(who.tenant, artifact.sha256)) {
                    *reply->add_missing() = digest;
                }
            }
        });
}

grpc::ServerReadReactor<v1::UploadArtifactRequest>* ArtifactService::UploadArtifact(
    grpc::CallbackServerContext* context, v1::UploadArtifactResponse* reply) {
    return new_upload(room_, *context, *reply);
}

grpc::ServerUnaryReactor* ArtifactService::GetUpload(grpc::CallbackServerContext* context,
                                                     const v1::GetUploadRequest* request,
                                                     v1::Upload* reply) {
    return reception_.answer(
        {context, request, reply}, kGetUpload, [=, this](const Principal& who, std::string&) {
            const ArtifactId artifact = artifact_of(request->digest(), "digest");
            const auto known = room_.artifacts.find_whole(who.tenant, artifact.sha256);
            *reply->mutable_digest() = request->digest();
            reply->set_is_complete(known.has_value());
            reply->set_committed_bytes(
                known ? known->size : room_.uploads.committed(who.tenant, artifact.sha256));
        });
}

grpc::ServerWriteReactor<v1::DownloadArtifactResponse>* ArtifactService::DownloadArtifact(
    grpc::CallbackServerContext* context, const v1::DownloadArtifactRequest* request) {
    auto* download = new_download(room_, *context, *request);
    free_content(*request);
    return download;
}

v1::Inspection ArtifactService::inspect(const std::string& tenant,
                                        const v1::InspectArtifactRequest& request) {
    if (request.file_name().size() > kMaxFileName) {
        refuse("file_name",
               "must have at most 255 bytes, got " + std::to_string(request.file_name().size()));
    }
    const auto artifact = room_.artifacts.find(tenant, request.sha256());
    if (!artifact) {
        throw StatusError(artifact_not_found_status(request.sha256()));
    }
    const auto format = to_core(request.format());
    return inspector_(room_.artifacts.open(tenant, *artifact).bytes(),
                      format ? std::string(format_extension(*format)) : request.file_name());
}

grpc::ServerUnaryReactor* ArtifactService::InspectArtifact(
    grpc::CallbackServerContext* context, const v1::InspectArtifactRequest* request,
    v1::Inspection* reply) {
    return reception_.inspect({context, request, reply}, kInspect,
                              [=, this](const Principal& who, std::string& subject) {
                                  require_sha256(request->sha256(), "sha256");
                                  subject = request->sha256();
                                  *reply = inspect(who.tenant, *request);
                              });
}

}  // namespace remesh
