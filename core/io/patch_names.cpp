#include "core/io/patch_names.h"

#include <algorithm>

namespace remesh::io {

std::string patch_name(const SurfaceMesh& surface, std::int32_t patch) {
    const auto names = static_cast<std::int64_t>(surface.patch_names.size());
    std::string name = patch >= 0 && patch < names
                           ? surface.patch_names[static_cast<std::size_t>(patch)]
                           : std::to_string(patch);
    std::replace_if(
        name.begin(), name.end(), [](char c) { return (c >= 0 && c <= ' ') || c == '\x7f'; }, '_');
    return name.empty() ? std::to_string(patch) : name;
}

std::int32_t patch_count(const SurfaceMesh& surface) {
    const auto largest = std::max_element(surface.patch.begin(), surface.patch.end());
    return largest == surface.patch.end() ? 0 : *largest + 1;
}

}  // namespace remesh::io
