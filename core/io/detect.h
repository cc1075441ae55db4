#pragma once

#include <cstddef>
#include <string_view>

#include "core/io/mesh_io.h"

namespace remesh::io {

/// So much of a file tells what it is.
inline constexpr std::size_t kHead = 4096;

/// Names what is surely no surface by the bytes it begins with: label maps, archives, pictures,
/// web pages, volume meshes. `head` may be cut off after kHead.
/// \throws Error{Unsupported} or Error{InvalidInput} with a sentence that says what the file is
void refuse_other_formats(std::string_view head);

/// The format of a surface by its content, or else by the name.
/// \throws Error{InvalidInput} if neither tells
[[nodiscard]] MeshFormat detect_format(std::string_view bytes, std::string_view name_hint);

}  // namespace remesh::io
