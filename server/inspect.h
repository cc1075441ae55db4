#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "remesh/v1/artifact.pb.h"

namespace remesh {

/// Tells what the bytes of a surface file hold; the hint is a file name or extension, or empty.
/// \throws Error as read_surface does, or StatusError
using Inspector = std::function<v1::Inspection(std::string_view bytes, const std::string& hint)>;

/// Looks by itself, bounded in the file's size and in triangles.
[[nodiscard]] v1::Inspection inspect_surface(std::string_view bytes, const std::string& hint);

/// Has a child process look, bounded in memory and time: a file that crashes the readers costs one
/// call.
/// \param program  the server's own program, which has to call `serve_inspection`
[[nodiscard]] Inspector inspector_in_child(const std::string& program);

/// The child's side of it: the file is stdin, the answer goes to stdout.
/// \return the exit status of the process
int serve_inspection(const std::string& hint);

}  // namespace remesh
