#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/geometry/size_image.h"

namespace remesh {

enum class ImageFormat { Nifti, Nrrd, MetaImage };

/// Bounds on what an image may ask for. Every declared size is checked against the bytes that are
/// there before memory is taken or a library sees the file.
struct ImageLimits {
    std::uint64_t max_voxels = std::uint64_t{1} << 27U;  ///< 512^3.
    std::uint64_t max_bytes = std::uint64_t{1} << 30U;   ///< Of all voxels.
};

/// How a surface's coordinates relate to an image's, which are in LPS, in millimetres.
struct SurfaceFrame {
    enum class Space { Unknown, Lps, Ras };
    Space space = Space::Unknown;  ///< Unknown is taken for LPS.
    double millimeters = 1.0;      ///< Of a model unit, > 0.
};

/// Reads wanted edge lengths, in millimetres, and takes them to the surface's frame.
///
/// NIfTI-1 (.nii, gzipped or not), NRRD (.nrrd, raw or gzip) and MetaImage (.mha) of one number a
/// voxel, in three dimensions with at least two voxels along each. Never opens another file,
/// whatever the bytes say: headers with detached data are refused.
///
/// \param format  absent: found from the content
/// \throws Error{InvalidInput} saying what is wrong
/// \throws Error{Unsupported} for another format, or another kind of image
/// \throws Error{TooLarge} if a limit would be passed
SizeImage read_size_image(std::string_view bytes, std::optional<ImageFormat> format = {},
                          const SurfaceFrame& frame = {}, const ImageLimits& limits = {});

}  // namespace remesh
