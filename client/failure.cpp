#include "client/failure.h"

#include <fmt/format.h>
#include <grpcpp/support/status.h>

#include <cerrno>
#include <system_error>

#include "client/error_details.h"
#include "client/text.h"

namespace remesh::client {
namespace {

ExitCode exit_code_of(grpc::StatusCode code) {
    switch (code) {
        case grpc::StatusCode::OK: return ExitCode::Ok;
        case grpc::StatusCode::CANCELLED: return ExitCode::Cancelled;
        case grpc::StatusCode::INVALID_ARGUMENT:
        case grpc::StatusCode::NOT_FOUND:
        case grpc::StatusCode::ALREADY_EXISTS:
        case grpc::StatusCode::FAILED_PRECONDITION:
        case grpc::StatusCode::OUT_OF_RANGE: return ExitCode::BadInput;
        case grpc::StatusCode::PERMISSION_DENIED:
        case grpc::StatusCode::UNAUTHENTICATED:
        case grpc::StatusCode::RESOURCE_EXHAUSTED: return ExitCode::Denied;
        case grpc::StatusCode::UNAVAILABLE:
        case grpc::StatusCode::DEADLINE_EXCEEDED: return ExitCode::Unavailable;
        case grpc::StatusCode::UNKNOWN:
        case grpc::StatusCode::ABORTED:
        case grpc::StatusCode::UNIMPLEMENTED:
        case grpc::StatusCode::INTERNAL:
        case grpc::StatusCode::DATA_LOSS:
        case grpc::StatusCode::DO_NOT_USE: break;
    }
    return ExitCode::JobFailed;
}

/// "failed to connect to all addresses; last error: UNKNOWN: ipv4:...: Connection refused" -> the
/// last part, which is what a person can act on.
std::string connection_trouble(const std::string& said) {
    const std::size_t colon = said.rfind(": ");
    const bool is_grpc_talk = said.starts_with("failed to connect to all addresses");
    return is_grpc_talk && colon != std::string::npos ? said.substr(colon + 2) : said;
}

}  // namespace

Failure to_failure(const grpc::Status& status, const std::string& server) {
    const ExitCode code = exit_code_of(status.error_code());
    const std::string said = explained(status);
    if (code == ExitCode::Unavailable) {
        return {code, fmt::format("can't reach the server at {}: {}", sanitised(server),
                                  connection_trouble(said))};
    }
    return {code, said.empty() ? fmt::format("the server answered with status {} and no message",
                                             static_cast<int>(status.error_code()))
                               : said};
}

Failure system_failure(const std::string& what) {
    return {ExitCode::Local, fmt::format("{}: {}", what, std::generic_category().message(errno))};
}

bool is_terminal(v1::Job::State state) {
    return state == v1::Job::STATE_SUCCEEDED || state == v1::Job::STATE_FAILED ||
           state == v1::Job::STATE_CANCELLED || state == v1::Job::STATE_QUARANTINED;
}

ExitCode exit_code_of(const v1::Job& job) {
    if (job.state() == v1::Job::STATE_SUCCEEDED) {
        return ExitCode::Ok;
    }
    if (job.state() == v1::Job::STATE_CANCELLED) {
        return ExitCode::Cancelled;
    }
    const std::string& reason = job.failure().reason();
    const bool refused = reason == "INVALID_INPUT" || reason == "UNSUPPORTED";
    return refused ? ExitCode::BadInput : ExitCode::JobFailed;
}

std::string reason_of(const v1::Job& job) {
    if (job.state() == v1::Job::STATE_CANCELLED) {
        return "the job was cancelled";
    }
    if (!job.failure().message().empty()) {
        return sanitised(job.failure().message());
    }
    return fmt::format("the job ended as {} and gave no reason", state_word(job.state()));
}

void require_success(const v1::Job& job) {
    const ExitCode code = exit_code_of(job);
    if (code != ExitCode::Ok) {
        throw Failure(code, reason_of(job));
    }
}

}  // namespace remesh::client
