#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace grpc {
class Status;
}

namespace remesh::client {

/// What a failed call says, for a person: its message and what its google.rpc details add (each
/// field that was refused, the limit, the resource, when to try again). Safe to print.
[[nodiscard]] std::string explained(const grpc::Status& status);

/// How long the server wants to be left alone, if it says so.
[[nodiscard]] std::optional<std::chrono::milliseconds> retry_delay(const grpc::Status& status);

}  // namespace remesh::client
