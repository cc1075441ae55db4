#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/options.h"
#include "remesh/v1/capability.pb.h"

namespace remesh::client {

/// What the command line says about outputs.
struct OutputWishes {
    std::vector<std::string> outputs{};  ///< Paths; the extension says the format. "-" is stdout.
    std::string output_dir{};            ///< For names made from the input's; empty: here.
};

struct PlannedFile {
    v1::Format format = v1::FORMAT_UNSPECIFIED;
    std::filesystem::path target{};
};

/// Gives every output a format, and names to outputs that have none: STEM_remeshed.EXT.
///
/// \throws Failure{Usage} if a format can't be told
[[nodiscard]] std::vector<PlannedFile> plan_outputs(const OutputWishes& wishes,
                                                    const JobArguments& job,
                                                    const std::filesystem::path& input,
                                                    const v1::GetCapabilitiesResponse& server);

/// Refuses before any work what could only fail after it, and what would destroy an input.
///
/// \throws Failure{Usage}
void require_writable(const std::vector<PlannedFile>& files,
                      const std::vector<std::filesystem::path>& inputs);

}  // namespace remesh::client
