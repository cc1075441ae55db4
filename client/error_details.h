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

/// Whether the same call may succeed in a moment: the server is away or shutting down, or others do
/// too much at a time (a passed limit with a delay; a full queue, quota or disk has no such end).
[[nodiscard]] bool is_passing(const grpc::Status& status);

}  // namespace remesh::client
