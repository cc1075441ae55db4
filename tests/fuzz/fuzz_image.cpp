// Feeds bytes to the reader of size images. Whatever they are, the answer is a lattice or an Error.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "core/error.h"
#include "core/image/read_image.h"

namespace {

// Small, so that a file of a few bytes that asks for gigabytes is found by the time it takes.
constexpr remesh::ImageLimits kLimits{.max_voxels = 1U << 20U, .max_bytes = 1U << 22U};

bool is_sound(const remesh::SizeImage& image) {
    std::size_t voxels = 1;
    for (const remesh::Index n : image.size) {
        voxels *= static_cast<std::size_t>(n);
    }
    return image.sizes.size() == voxels && image.origin.allFinite() && image.axes.allFinite() &&
           (image.spacing.array() > 0.0).all();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    try {
        if (!is_sound(remesh::read_size_image(bytes, {}, {}, kLimits))) {
            std::abort();
        }
    } catch (const remesh::Error&) {
    }
    return 0;
}
