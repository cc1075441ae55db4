#pragma once

#include <string_view>

#include "core/io/inflate.h"
#include "core/io/mesh_io.h"

/// One reader for each family of formats. All take the whole file, no longer gzipped, and throw
/// Error{InvalidInput}, Error{Unsupported} or Error{TooLarge} as read_surface() documents. Those
/// that know scalars at vertices take the name of the one to keep, which may be empty.
namespace remesh::io {

ReadResult read_stl(std::string_view bytes, const ReadLimits& limits);
ReadResult read_ply(std::string_view bytes, const ReadLimits& limits, std::string_view size_field);
ReadResult read_off(std::string_view bytes, const ReadLimits& limits);
ReadResult read_obj(std::string_view bytes, const ReadLimits& limits);
ReadResult read_vtk(std::string_view bytes, const ReadLimits& limits, std::string_view size_field);
/// Arrays inside these two may be compressed: `budget` bounds what they yield.
ReadResult read_vtp(std::string_view bytes, const ReadLimits& limits, std::string_view size_field,
                    InflateBudget& budget);
ReadResult read_gifti(std::string_view bytes, const ReadLimits& limits, InflateBudget& budget);

/// Whether the size fits a binary STL exactly: 84 bytes and 50 for each triangle it says.
[[nodiscard]] bool has_exact_binary_stl_size(std::string_view bytes);

}  // namespace remesh::io
