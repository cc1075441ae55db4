#include <grpcpp/support/error_details.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "core/error.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/convert.h"

namespace remesh {
namespace {

/// A status with an ErrorInfo and whatever else is added.
class StatusBuilder {
public:
    StatusBuilder(grpc::StatusCode code, const std::string& message, const std::string& reason) {
        status_.set_code(code);
        status_.set_message(message);
        google::rpc::ErrorInfo info;
        info.set_reason(reason);
        info.set_domain("remesh");
        add(info);
    }

    void add(const google::protobuf::Message& detail) { status_.add_details()->PackFrom(detail); }

    [[nodiscard]] grpc::Status build() const {
        return {static_cast<grpc::StatusCode>(status_.code()), status_.message(),
                status_.SerializeAsString()};
    }

private:
    google::rpc::Status status_;
};

google::rpc::ResourceInfo resource(const std::string& type, const std::string& name,
                                   const std::string& description) {
    google::rpc::ResourceInfo info;
    info.set_resource_type(type);
    info.set_resource_name(name);
    info.set_description(description);
    return info;
}

google::rpc::RetryInfo retry_after(int seconds) {
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_seconds(seconds);
    return retry;
}

StatusBuilder quota_failure(const std::string& subject, const std::string& description) {
    StatusBuilder status(grpc::StatusCode::RESOURCE_EXHAUSTED, description, "LIMIT_PASSED");
    google::rpc::QuotaFailure failure;
    auto* violation = failure.add_violations();
    violation->set_subject(subject);
    violation->set_description(description);
    status.add(failure);
    return status;
}

grpc::Status bad_request_status(const JobError& error) {
    StatusBuilder status(grpc::StatusCode::INVALID_ARGUMENT, error.what(), "BAD_REQUEST");
    google::rpc::BadRequest details;
    for (const FieldProblem& problem : error.problems()) {
        auto* violation = details.add_field_violations();
        violation->set_field(problem.field);
        violation->set_description(problem.message);
    }
    status.add(details);
    return status.build();
}

grpc::Status status_of(const JobError& error) {
    const std::string message = error.what();
    switch (error.code()) {
        case JobErrorCode::BadRequest: return bad_request_status(error);
        case JobErrorCode::NotFound: {
            StatusBuilder status(grpc::StatusCode::NOT_FOUND, message, "JOB_NOT_FOUND");
            status.add(resource("remesh.v1.Job", error.subject(), message));
            return status.build();
        }
        case JobErrorCode::MissingInput: {
            StatusBuilder status(grpc::StatusCode::FAILED_PRECONDITION, message, "INPUT_MISSING");
            status.add(resource("remesh.v1.Artifact", error.subject(),
                                "upload it, then create the job again"));
            return status.build();
        }
        case JobErrorCode::RequestIdReused:
            return StatusBuilder(grpc::StatusCode::ALREADY_EXISTS, message, "REQUEST_ID_REUSED")
                .build();
        case JobErrorCode::LimitPassed: return too_many_status(error.subject(), message);
        case JobErrorCode::NotTerminal: {
            StatusBuilder status(grpc::StatusCode::FAILED_PRECONDITION, message,
                                 "JOB_NOT_TERMINAL");
            status.add(resource("remesh.v1.Job", error.subject(), "cancel it first"));
            return status.build();
        }
        case JobErrorCode::NotRetryable: {
            StatusBuilder status(grpc::StatusCode::FAILED_PRECONDITION, message,
                                 "JOB_NOT_RETRYABLE");
            status.add(resource("remesh.v1.Job", error.subject(), message));
            return status.build();
        }
        case JobErrorCode::Changed:
            return StatusBuilder(grpc::StatusCode::ABORTED, message, "ETAG_MISMATCH").build();
        case JobErrorCode::ShuttingDown: return shutting_down_status();
    }
    return {grpc::StatusCode::INTERNAL, "unknown error"};
}

grpc::Status status_of(const AccessError& error) {
    switch (error.code()) {
        case AccessErrorCode::Unauthenticated:
            return StatusBuilder(grpc::StatusCode::UNAUTHENTICATED, error.what(),
                                 "CREDENTIAL_NEEDED")
                .build();
        case AccessErrorCode::Denied:
            return StatusBuilder(grpc::StatusCode::PERMISSION_DENIED, error.what(), "NOT_ALLOWED")
                .build();
    }
    return {grpc::StatusCode::INTERNAL, "unknown error"};
}

grpc::StatusCode code_of(ErrorCode code) {
    switch (code) {
        case ErrorCode::InvalidInput: return grpc::StatusCode::INVALID_ARGUMENT;
        case ErrorCode::Unsupported: return grpc::StatusCode::INVALID_ARGUMENT;
        case ErrorCode::Unmeshable: return grpc::StatusCode::FAILED_PRECONDITION;
        case ErrorCode::TooLarge: return grpc::StatusCode::RESOURCE_EXHAUSTED;
        case ErrorCode::Cancelled: return grpc::StatusCode::CANCELLED;
        case ErrorCode::Internal: return grpc::StatusCode::INTERNAL;
    }
    return grpc::StatusCode::INTERNAL;
}

grpc::Status failed_status() {
    return StatusBuilder(grpc::StatusCode::INTERNAL, "the server failed; see its log", "INTERNAL")
        .build();
}

grpc::Status storage_full_status() {
    StatusBuilder status(grpc::StatusCode::RESOURCE_EXHAUSTED,
                         "the server's disk is full; nothing was changed", "STORAGE_FULL");
    status.add(retry_after(60));
    return status.build();
}

grpc::Status artifact_damaged_status() {
    return StatusBuilder(grpc::StatusCode::DATA_LOSS,
                         "the stored bytes are gone or damaged; upload them again, or run their "
                         "job again with skip_cache",
                         "ARTIFACT_DAMAGED")
        .build();
}

}  // namespace

grpc::Status to_status(const std::exception_ptr& error) {
    try {
        std::rethrow_exception(error);
    } catch (const JobError& job_error) {
        return status_of(job_error);
    } catch (const StatusError& status_error) {
        return status_error.status();
    } catch (const AccessError& access_error) {
        return status_of(access_error);
    } catch (const Error& core_error) {
        const ErrorCode code = core_error.code();
        return StatusBuilder(code_of(code), core_error.what(), reason_of(code)).build();
    } catch (const StoreError& store_error) {
        spdlog::error("event=store_failed message=\"{}\"", store_error.what());
        switch (store_error.kind()) {
            case StoreError::Kind::Failed: break;
            case StoreError::Kind::Full: return storage_full_status();
            case StoreError::Kind::Lost: return artifact_damaged_status();
        }
        return failed_status();
    } catch (const std::exception& other) {
        // What it says is for the operator: it may name paths.
        spdlog::error("event=call_failed message=\"{}\"", other.what());
        return failed_status();
    }
}

grpc::Status shutting_down_status() {
    StatusBuilder status(grpc::StatusCode::UNAVAILABLE, "the server is shutting down",
                         "SHUTTING_DOWN");
    status.add(retry_after(2));
    return status.build();
}

grpc::Status artifact_not_found_status(const std::string& sha256) {
    StatusBuilder status(grpc::StatusCode::NOT_FOUND, "there is no such artifact",
                         "ARTIFACT_NOT_FOUND");
    status.add(resource("remesh.v1.Artifact", sha256, "there is no such artifact"));
    return status.build();
}

grpc::Status too_many_status(const std::string& subject, const std::string& description) {
    return quota_failure(subject, description).build();
}

grpc::Status too_many_now_status(const std::string& subject, const std::string& description) {
    StatusBuilder status = quota_failure(subject, description);
    status.add(retry_after(1));
    return status.build();
}

}  // namespace remesh
