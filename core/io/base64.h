#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace remesh::io {

/// The first `limit` bytes that base64 text stands for, or fewer if it ends before.
///
/// White space is skipped. Decoding goes on after padding, since VTK writes the header of an array
/// and its data as two base64 texts without anything between them. Stops at any other character.
[[nodiscard]] std::string decode_base64(std::string_view text,
                                        std::size_t limit = std::string::npos);

/// Appends the base64 text of `bytes`, padded.
void append_base64(std::string_view bytes, std::string& out);

}  // namespace remesh::io
