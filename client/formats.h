#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "remesh/v1/capability.pb.h"
#include "remesh/v1/options.pb.h"

namespace remesh::client {

/// The format that `word` names ("msh22"). \throws Failure{Usage} with the words there are
[[nodiscard]] v1::Format format_named(const std::string& word);

/// The format that the server writes for a path's extension, its first if several share one.
///
/// \throws Failure{Usage} with the extensions there are
[[nodiscard]] v1::Format format_for(const std::filesystem::path& path,
                                    const v1::GetCapabilitiesResponse& server);

/// The extension the server uses for a format, with its dot.
[[nodiscard]] std::string extension_of(v1::Format format,
                                       const v1::GetCapabilitiesResponse& server);

/// The formats that words name; if there are none, one for tets (if wanted) and one for the
/// surface.
[[nodiscard]] std::vector<v1::Format> wanted_formats(const std::vector<std::string>& words,
                                                     const v1::Options& options);

/// "aorta.stl.gz" -> "aorta"; what an output's name starts with.
[[nodiscard]] std::string stem_of(const std::filesystem::path& input);

}  // namespace remesh::client
