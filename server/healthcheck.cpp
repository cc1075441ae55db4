#include "server/healthcheck.h"

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <future>

namespace remesh {

// grpc++ has the service but no stub for it. The messages are small enough to be written out: an
// empty HealthCheckRequest, and a HealthCheckResponse whose field 1 is 1 for SERVING.
bool is_serving(const std::string& address, const std::string& tls_ca) {
    grpc::SslCredentialsOptions tls;
    tls.pem_root_certs = tls_ca;
    grpc::GenericStub stub(grpc::CreateChannel(
        address, tls_ca.empty() ? grpc::InsecureChannelCredentials() : grpc::SslCredentials(tls)));
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(3));
    const grpc::Slice nothing("");
    const grpc::ByteBuffer request(&nothing, 1);
    grpc::ByteBuffer response;
    std::promise<grpc::Status> done;
    stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", {}, &request, &response,
                   [&](grpc::Status status) { done.set_value(std::move(status)); });
    if (!done.get_future().get().ok()) {
        return false;
    }
    grpc::Slice bytes;
    return response.DumpToSingleSlice(&bytes).ok() &&
           std::string(reinterpret_cast<const char*>(bytes.begin()), bytes.size()) == "\x08\x01";
}

}  // namespace remesh
