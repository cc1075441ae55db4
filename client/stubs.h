#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>

#include "remesh/v1/artifact.grpc.pb.h"
#include "remesh/v1/capability.grpc.pb.h"
#include "remesh/v1/job.grpc.pb.h"

namespace remesh::client {

/// The generated side of a Connection, apart from it because gRPC's headers cost seconds each.
struct Stubs {
    explicit Stubs(std::shared_ptr<grpc::Channel> to)
        : channel(std::move(to)), jobs(channel), artifacts(channel), capabilities(channel) {}

    std::shared_ptr<grpc::Channel> channel;
    v1::JobService::Stub jobs;
    v1::ArtifactService::Stub artifacts;
    v1::CapabilityService::Stub capabilities;
};

}  // namespace remesh::client
