#include "server/doorkeeper.h"

#include <grpcpp/security/auth_context.h>

#include <exception>

#include "server/call.h"
#include "server/convert.h"

namespace remesh {

grpc::Status Doorkeeper::Process(const InputMetadata& headers, grpc::AuthContext* peer,
                                 OutputMetadata* /*consumed*/, OutputMetadata* /*response*/) {
    const auto found = headers.find(":path");
    const grpc::string_ref path = found != headers.end() ? found->second : "";
    if (path.starts_with("/grpc.health.v1.Health/")) {
        return grpc::Status::OK;
    }
    try {
        const Papers papers = papers_of(headers, peer);
        if (path.starts_with("/remesh.v1.")) {
            gate_.require_acquaintance(papers);
        } else {  // Reflection, which asks nobody who they are.
            static_cast<void>(gate_.admit(papers, Role::Viewer, "reflection"));
        }
        return grpc::Status::OK;
    } catch (...) {
        return to_status(std::current_exception());
    }
}

}  // namespace remesh
