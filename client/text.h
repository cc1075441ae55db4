#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "remesh/v1/job.pb.h"
#include "remesh/v1/mesh.pb.h"

namespace remesh::client {

/// Makes text that others wrote safe to print on a terminal.
///
/// Line breaks and tabs become spaces; other control characters, those that turn the direction of
/// text around, and bytes that aren't UTF-8 become "?": a label must not be able to move the
/// cursor, to recolour the screen or to show a file name backwards.
[[nodiscard]] std::string sanitised(std::string_view text);

/// Number of columns that sanitised UTF-8 takes, one per code point.
[[nodiscard]] std::size_t columns(std::string_view text);

[[nodiscard]] std::string with_thousands(std::int64_t number);  ///< 1234567 -> "1,234,567"
[[nodiscard]] std::string bytes_word(std::int64_t bytes);       ///< 1234567 -> "1.2 MB"
[[nodiscard]] std::string duration_word(double seconds);        ///< 75.2 -> "1 min 15 s"
[[nodiscard]] std::string number_word(double value);            ///< Four significant digits.

/// Words for the contract's enumerations, without their prefix.
[[nodiscard]] std::string state_word(v1::Job::State state);  ///< "SUCCEEDED"
[[nodiscard]] std::string stage_word(v1::Stage stage);       ///< "relax"
[[nodiscard]] std::string format_word(v1::Format format);    ///< "msh41"
[[nodiscard]] std::string kind_word(v1::Output::Kind kind);  ///< "tetrahedra"
[[nodiscard]] std::string lower_case(std::string_view text);

/// One row a vector; columns are padded to their widest cell, the first to the left, the others
/// to the right.
[[nodiscard]] std::string aligned(const std::vector<std::vector<std::string>>& rows);

}  // namespace remesh::client
