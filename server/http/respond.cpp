#include "server/http/respond.h"

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include <httplib.h>
#include <memory>
#include <utility>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace remesh::http {
namespace {

using nlohmann::json;

int http_status_of(grpc::StatusCode code) {
    switch (code) {
        case grpc::StatusCode::OK: return 200;
        case grpc::StatusCode::INVALID_ARGUMENT:
        case grpc::StatusCode::OUT_OF_RANGE:
        case grpc::StatusCode::FAILED_PRECONDITION: return 400;
        case grpc::StatusCode::UNAUTHENTICATED: return 401;
        case grpc::StatusCode::PERMISSION_DENIED: return 403;
        case grpc::StatusCode::NOT_FOUND: return 404;
        case grpc::StatusCode::ALREADY_EXISTS:
        case grpc::StatusCode::ABORTED: return 409;
        case grpc::StatusCode::RESOURCE_EXHAUSTED: return 429;
        case grpc::StatusCode::CANCELLED: return 499;
        case grpc::StatusCode::UNIMPLEMENTED: return 501;
        case grpc::StatusCode::UNAVAILABLE: return 503;
        case grpc::StatusCode::DEADLINE_EXCEEDED: return 504;
        default: return 500;
    }
}

std::string dumped(const json& value) {
    return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

json error_of(const grpc::Status& status) {
    json error{{"message", status.error_message()}};
    google::rpc::Status details;
    details.ParseFromString(status.error_details());
    for (const auto& any : details.details()) {
        google::rpc::ErrorInfo info;
        google::rpc::BadRequest bad;
        if (any.UnpackTo(&info)) {
            error["reason"] = info.reason();
        } else if (any.UnpackTo(&bad)) {
            for (const auto& violation : bad.field_violations()) {
                error["fields"].push_back(
                    {{"field", violation.field()}, {"description", violation.description()}});
            }
        }
    }
    return {{"error", std::move(error)}};
}

}  // namespace

std::string to_json(const google::protobuf::Message& message) {
    google::protobuf::util::JsonPrintOptions options;
    options.preserve_proto_field_names = true;
    std::string text;
    const auto status = google::protobuf::util::MessageToJsonString(message, &text, options);
    return status.ok() ? text : "{}";
}

void send(httplib::Response& response, std::string text, const std::string& type) {
    const auto body = std::make_shared<const std::string>(std::move(text));
    if (body->empty()) {
        response.set_content("", type);
        return;
    }
    response.set_content_provider(
        body->size(), type,
        [body](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
            return sink.write(body->data() + offset, length);
        });
}

void send(httplib::Response& response, const google::protobuf::Message& message) {
    send(response, to_json(message), "application/json");
}

void refuse(httplib::Response& response, int http_status, std::string_view reason,
            std::string_view message) {
    response.status = http_status;
    send(response, dumped({{"error", {{"reason", reason}, {"message", message}}}}),
         "application/json");
}

void refuse(httplib::Response& response, const grpc::Status& status) {
    response.status = http_status_of(status.error_code());
    send(response, to_json(status), "application/json");
}

std::string to_json(const grpc::Status& status) {
    return dumped(error_of(status));
}

}  // namespace remesh::http
