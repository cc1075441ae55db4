#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/security/auth_context.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>
#include <grpcpp/support/string_ref.h>

#include <exception>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "server/auth/gate.h"
#include "server/convert.h"

namespace remesh {

/// Who may make a call, and whether it's written down.
struct Rule {
    const char* action;  ///< The method's name.
    Role least;
    bool is_audited;
};

/// What the caller of a call shows.
[[nodiscard]] Papers papers_of(const grpc::CallbackServerContext& context);
/// The same but for where the call comes from, which isn't known before there is a context.
/// \param peer  may be null
[[nodiscard]] Papers papers_of(const std::multimap<grpc::string_ref, grpc::string_ref>& headers,
                               const grpc::AuthContext* peer);

/// Whether a bearer token (empty: none) allows something, for callers that don't come by gRPC.
[[nodiscard]] grpc::Status admission(Gate& gate, const std::string& token, Role least,
                                     std::string_view action);

/// The name of a status code: "OK", "NOT_FOUND".
[[nodiscard]] std::string code_name(grpc::StatusCode code);

/// Frees what a message of a call holds, which gRPC keeps until the call ends, once nobody reads it
/// any more. Clearing alone keeps the room of its strings and lists.
void free_content(const google::protobuf::Message& message);
/// The same of a message that isn't parsed.
void free_content(const grpc::ByteBuffer& message);

/// Lets a caller in, runs `handler(who, subject)` and writes down what became of it, if the rule
/// says so. The handler sets `subject` as soon as it knows what the call is about.
/// \return the status of the call
template <typename Handler>
grpc::Status guarded(Gate& gate, const grpc::CallbackServerContext& context, const Rule& rule,
                     Handler&& handler) {
    try {
        const Papers papers = papers_of(context);
        const Principal who = gate.admit(papers, rule.least, rule.action);
        std::string subject;
        grpc::Status status;
        try {
            handler(who, subject);
        } catch (...) {
            status = to_status(std::current_exception());
        }
        if (rule.is_audited) {
            gate.record(who, papers.peer, rule.action, subject, code_name(status.error_code()));
        }
        return status;
    } catch (...) {
        return to_status(std::current_exception());
    }
}

}  // namespace remesh
