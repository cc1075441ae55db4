#include "server/doorkeeper.h"

#include <grpcpp/security/auth_context.h>

#include <exception>

#include "server/call.h"
#include "server/convert.h"

namespace remesh {

grpc::Status Doorkeeper::Process(const InputMetadata& headers, grpc::AuthContext* peer,
                                 OutputMetadata* /*consumed*/, OutputMetadata* /*response*/) {
    const auto path = headers.find(":path");
    if (path != headers.end() && path->second.starts_with("/grpc.health.v1.Health/")) {
        return grpc::Status::OK;
    }
    try {
        gate_.require_acquaintance(papers_of(headers, peer));
        return grpc::Status::OK;
    } catch (...) {
        return to_status(std::current_exception());
    }
}

}  // namespace remesh
