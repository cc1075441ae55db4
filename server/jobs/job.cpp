#include "server/jobs/job.h"

namespace remesh {
namespace {

std::string summary_of(const std::vector<FieldProblem>& problems) {
    std::string text;
    for (const FieldProblem& problem : problems) {
        text += (text.empty() ? "" : "; ") + problem.message;
    }
    return text;
}

}  // namespace

const char* reason_of(ErrorCode code) {
    switch (code) {
        case ErrorCode::InvalidInput: return "INVALID_INPUT";
        case ErrorCode::Unsupported: return "UNSUPPORTED";
        case ErrorCode::Unmeshable: return "UNMESHABLE";
        case ErrorCode::TooLarge: return "TOO_LARGE";
        case ErrorCode::Cancelled: return "CANCELLED";
        case ErrorCode::Internal: return "INTERNAL";
    }
    return "INTERNAL";
}

JobError::JobError(std::vector<FieldProblem> problems)
    : std::runtime_error(summary_of(problems)),
      code_(JobErrorCode::BadRequest),
      problems_(std::move(problems)) {}

}  // namespace remesh
