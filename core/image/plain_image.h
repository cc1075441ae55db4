#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "core/image/read_image.h"

namespace remesh::image {

/// An image file that a library may be given: a header of ours with nothing in it but what was
/// looked at, and as many bytes of voxels after it as that says, not compressed.
struct PlainImage {
    ImageFormat format = ImageFormat::Nifti;
    std::array<std::int64_t, 3> size{};
    std::string header{};
    std::string_view voxels{};  ///< Of the file, or of `inflated`.
    std::string inflated{};
};

// All throw as read_size_image does.

PlainImage plain_nifti(std::string_view bytes, const ImageLimits& limits);
PlainImage plain_nrrd(std::string_view bytes, const ImageLimits& limits);
PlainImage plain_meta(std::string_view bytes, const ImageLimits& limits);

/// Reads a plain image with ITK: geometry in LPS, millimetres.
SizeImage read_with_itk(const PlainImage& plain);

// What the formats share.

/// Checks the size of a volume and tells how many bytes its voxels have.
std::uint64_t checked_bytes(const PlainImage& plain, std::uint64_t bytes_per_voxel,
                            std::string_view format, const ImageLimits& limits);
/// Takes the voxels from what follows a header, inflating them if they are compressed.
void take_voxels(PlainImage& plain, std::string_view rest, bool is_compressed, std::uint64_t bytes,
                 std::string_view format, std::size_t file_size);
/// Goes over the lines of a text header until `line` returns false. \return what follows it
std::string_view for_each_line(std::string_view bytes, std::string_view format,
                               const std::function<bool(std::string_view)>& line);
/// Three whole numbers. \param what  names them in errors
std::array<std::int64_t, 3> three_counts(std::string_view text, const std::string& what);

}  // namespace remesh::image
