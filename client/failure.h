#pragma once

#include <stdexcept>
#include <string>

#include "remesh/v1/job.pb.h"

namespace grpc {
class Status;
}

namespace remesh::client {

/// What the program's exit status says. Scripts rely on the numbers.
enum class ExitCode : int {
    Ok = 0,
    Local = 1,        ///< Something on this machine: a full disk, a closed pipe, no server program.
    Usage = 2,        ///< The command line isn't right.
    BadInput = 3,     ///< A file or an option was refused: fix the request.
    JobFailed = 4,    ///< The job ran and failed, or the server has a defect.
    Cancelled = 5,    ///< Somebody cancelled the job.
    Unavailable = 6,  ///< The server can't be reached or is shutting down.
    Denied = 7,       ///< Not allowed, or over a quota.
    Interrupted = 130,
};

/// Ends a command: main prints `what()` on stderr and exits with `code()`.
class Failure : public std::runtime_error {
public:
    Failure(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
    [[nodiscard]] ExitCode code() const { return code_; }

private:
    ExitCode code_;
};

/// Turns a call that failed into a Failure; `server` is named when it can't be reached.
[[nodiscard]] Failure to_failure(const grpc::Status& status, const std::string& server);

/// Turns errno into a Failure{Local}: "can't write out.vtu: No space left on device".
[[nodiscard]] Failure system_failure(const std::string& what);

[[nodiscard]] bool is_terminal(v1::Job::State state);

/// What a terminal job means for the exit status.
[[nodiscard]] ExitCode exit_code_of(const v1::Job& job);

/// Why a terminal job has no result, in one sentence without its name.
[[nodiscard]] std::string reason_of(const v1::Job& job);

/// \throws Failure unless the terminal `job` succeeded
void require_success(const v1::Job& job);

}  // namespace remesh::client
