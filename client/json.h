#pragma once

#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

#include <string>

namespace remesh::client {

/// A message as JSON for scripts: field names as in the contract, enumeration values without their
/// prefix ("SUCCEEDED"), numbers as numbers, times as RFC 3339, durations in seconds.
///
/// Scalar fields without presence always stand there; messages, `optional` and oneof fields only
/// when they are set.
[[nodiscard]] nlohmann::ordered_json to_json(const google::protobuf::Message& message);

/// One line, ASCII only, so that it's safe on any terminal.
[[nodiscard]] std::string json_line(const google::protobuf::Message& message);

}  // namespace remesh::client
