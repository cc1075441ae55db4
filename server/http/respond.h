#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/support/status.h>

#include <string>
#include <string_view>

namespace httplib {
struct Response;
}

namespace remesh::http {

/// A message as JSON: field names as in the proto files, defaults left out.
[[nodiscard]] std::string to_json(const google::protobuf::Message& message);

/// Answers with a text, never compressed on the way: httplib would take Brotli's slowest level.
void send(httplib::Response& response, std::string text, const std::string& type);
void send(httplib::Response& response, const google::protobuf::Message& message);

/// Answers with {"error": {"code", "reason", "message", "fields"}}.
void refuse(httplib::Response& response, int http_status, std::string_view reason,
            std::string_view message);
/// The same for what the API said.
void refuse(httplib::Response& response, const grpc::Status& status);

/// The error of a status as JSON, for the data of an event.
[[nodiscard]] std::string to_json(const grpc::Status& status);

}  // namespace remesh::http
