#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "remesh/v1/artifact.pb.h"
#include "server/jobs/engine.h"

namespace remesh {

/// Tells what the bytes of a surface file hold; the hint is a file name or extension, or empty.
/// \throws Error as read_surface does, or StatusError
using Inspector = std::function<v1::Inspection(std::string_view bytes, const std::string& hint)>;

/// Tells what a job of this spec, a serialized v1::JobSpec, needs with these inputs.
/// \throws Error as read_surface and read_size_image do
using Estimator = std::function<JobEstimate(std::string_view spec, const JobFiles& inputs)>;

/// Looks by itself, bounded in the file's size and in triangles.
[[nodiscard]] v1::Inspection inspect_surface(std::string_view bytes, const std::string& hint);

// Have a child process look, bounded in memory and time: a file that crashes the readers costs one
// call. `program` is the server's own program, which has to call what is below.

[[nodiscard]] Inspector inspector_in_child(const std::string& program);
[[nodiscard]] Estimator estimator_in_child(const std::string& program);

// The child's side of it: the question comes by stdin, the answer goes to stdout. They return the
// exit status of the process.

int serve_inspection(const std::string& hint);
int serve_estimate(const Engine& engine);

}  // namespace remesh
