#include "client/error_details.h"

#include <fmt/format.h>
#include <grpcpp/support/status.h>

#include <string_view>

#include "client/text.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace remesh::client {
namespace {

template <typename Detail>
std::optional<Detail> detail_of(const grpc::Status& status) {
    google::rpc::Status details;
    if (!details.ParseFromString(status.error_details())) {
        return std::nullopt;
    }
    for (const auto& any : details.details()) {
        Detail detail;
        if (any.UnpackTo(&detail)) {
            return detail;
        }
    }
    return std::nullopt;
}

/// "spec.options.relaxation.damping must be in (0, 2], got 7": the request's name for the field in
/// place of the one that the sentence begins with.
std::string field_sentence(const google::rpc::BadRequest::FieldViolation& violation) {
    const std::string description = sanitised(violation.description());
    const std::string field = sanitised(violation.field());
    const std::size_t space = description.find(' ');
    const std::string_view first = std::string_view(description).substr(0, space);
    const std::size_t dot = first.rfind('.');
    const std::string_view last = dot == std::string_view::npos ? first : first.substr(dot + 1);
    const bool begins_with_field = !last.empty() && field.ends_with(last);
    return begins_with_field && space != std::string::npos
               ? field + description.substr(space)
               : fmt::format("{}: {}", field, description);
}

std::string bad_request(const google::rpc::BadRequest& details) {
    std::string text;
    for (const auto& violation : details.field_violations()) {
        text += (text.empty() ? "" : "\n  ") + field_sentence(violation);
    }
    return details.field_violations_size() > 1
               ? fmt::format("{} fields were refused:\n  {}", details.field_violations_size(), text)
               : text;
}

std::string quota(const google::rpc::QuotaFailure& details) {
    std::string text;
    for (const auto& violation : details.violations()) {
        text += fmt::format("{}{}", text.empty() ? "" : ", ", sanitised(violation.subject()));
    }
    return text;
}

}  // namespace

std::string explained(const grpc::Status& status) {
    std::string text = sanitised(status.error_message());
    const auto request = detail_of<google::rpc::BadRequest>(status);
    if (request && request->field_violations_size() > 0) {
        text = bad_request(*request);
    }
    if (const auto details = detail_of<google::rpc::QuotaFailure>(status)) {
        text += fmt::format(" (limit: {})", quota(*details));
    }
    if (const auto details = detail_of<google::rpc::ResourceInfo>(status)) {
        text += fmt::format(
            " ({}{})", sanitised(details->resource_name()),
            details->description().empty() || details->description() == status.error_message()
                ? ""
                : ": " + sanitised(details->description()));
    }
    if (const auto delay = retry_delay(status)) {
        text += fmt::format("; try again in {}",
                            duration_word(static_cast<double>(delay->count()) / 1e3));
    }
    return text;
}

std::optional<std::chrono::milliseconds> retry_delay(const grpc::Status& status) {
    const auto details = detail_of<google::rpc::RetryInfo>(status);
    if (!details) {
        return std::nullopt;
    }
    return std::chrono::seconds(details->retry_delay().seconds()) +
           std::chrono::milliseconds(details->retry_delay().nanos() / 1'000'000);
}

bool is_passing(const grpc::Status& status) {
    return status.error_code() == grpc::StatusCode::UNAVAILABLE ||
           (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED && retry_delay(status) &&
            detail_of<google::rpc::QuotaFailure>(status));
}

}  // namespace remesh::client
