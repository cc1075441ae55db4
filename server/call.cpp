#include "server/call.h"

#include <array>
#include <memory>

namespace remesh {

Papers papers_of(const grpc::CallbackServerContext& context) {
    const auto peer = context.auth_context();
    Papers papers = papers_of(context.client_metadata(), peer.get());
    papers.peer = context.peer();
    return papers;
}

Papers papers_of(const std::multimap<grpc::string_ref, grpc::string_ref>& headers,
                 const grpc::AuthContext* peer) {
    Papers papers;
    if (const auto found = headers.find("authorization"); found != headers.end()) {
        papers.authorization.emplace(found->second.data(), found->second.size());
    }
    if (peer != nullptr && peer->IsPeerAuthenticated()) {
        for (const auto& name : peer->GetPeerIdentity()) {
            papers.certificate_names.emplace_back(name.data(), name.size());
        }
    }
    return papers;
}

grpc::Status admission(Gate& gate, const std::string& token, Role least, std::string_view action) {
    Papers papers;
    if (!token.empty()) {
        papers.authorization = "Bearer " + token;
    }
    papers.peer = "http";
    try {
        static_cast<void>(gate.admit(papers, least, action));
        return grpc::Status::OK;
    } catch (...) {
        return to_status(std::current_exception());
    }
}

// gRPC made the messages for one call, as ones that can be changed.

void free_content(const google::protobuf::Message& message) {
    auto& content = const_cast<google::protobuf::Message&>(message);
    const std::unique_ptr<google::protobuf::Message> empty(content.New());
    content.GetReflection()->Swap(&content, empty.get());
}

void free_content(const grpc::ByteBuffer& message) {
    const_cast<grpc::ByteBuffer&>(message).Clear();
}

std::string code_name(grpc::StatusCode code) {
    static constexpr std::array<const char*, 17> kNames{"OK",
                                                        "CANCELLED",
                                                        "UNKNOWN",
                                                        "INVALID_ARGUMENT",
                                                        "DEADLINE_EXCEEDED",
                                                        "NOT_FOUND",
                                                        "ALREADY_EXISTS",
                                                        "PERMISSION_DENIED",
                                                        "RESOURCE_EXHAUSTED",
                                                        "FAILED_PRECONDITION",
                                                        "ABORTED",
                                                        "OUT_OF_RANGE",
                                                        "UNIMPLEMENTED",
                                                        "INTERNAL",
                                                        "UNAVAILABLE",
                                                        "DATA_LOSS",
                                                        "UNAUTHENTICATED"};
    const auto index = static_cast<std::size_t>(code);
    return index < kNames.size() ? kNames[index] : "UNKNOWN";
}

}  // namespace remesh
