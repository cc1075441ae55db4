#pragma once

#include <grpcpp/security/auth_metadata_processor.h>

#include "server/auth/gate.h"

namespace remesh {

/// Ends the calls of strangers as they come, by their headers. The services see a call only once
/// its first message is there; who never sends one would hold its memory for as long as they like.
/// gRPC asks it on connections with TLS only.
class Doorkeeper final : public grpc::AuthMetadataProcessor {
public:
    explicit Doorkeeper(Gate& gate) : gate_(gate) {}

    [[nodiscard]] bool IsBlocking() const override { return false; }
    grpc::Status Process(const InputMetadata& headers, grpc::AuthContext* peer,
                         OutputMetadata* consumed, OutputMetadata* response) override;

private:
    Gate& gate_;
};

}  // namespace remesh
