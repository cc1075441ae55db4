#include "core/io/vtk_piece.h"

#include <algorithm>
#include <limits>
#include <span>

#include "core/error.h"
#include "core/io/numbers.h"

namespace remesh::io {
namespace {

void check(const VtkPiece& piece, const VtkCells& cells, const std::string& format) {
    const auto points = static_cast<std::int64_t>(piece.points.size() / 3);
    for (std::size_t i = 1; i < cells.offsets.size(); ++i) {
        if (cells.offsets[0] != 0 || cells.offsets[i] < cells.offsets[i - 1]) {
            throw Error(ErrorCode::InvalidInput,
                        format + ": the offsets of the cells aren't in order at cell " +
                            grouped(i) + ", counting from 1");
        }
    }
    if (!cells.offsets.empty() &&
        cells.offsets.back() > static_cast<std::int64_t>(cells.corners.size())) {
        throw Error(ErrorCode::InvalidInput,
                    format + ": the cells have " + grouped(cells.offsets.back()) +
                        " corners but only " + grouped(cells.corners.size()) + " are there");
    }
    for (const std::int64_t corner : cells.corners) {
        if (corner < 0 || corner >= points) {
            throw Error(ErrorCode::InvalidInput, format + ": a cell refers to point " +
                                                     grouped(corner) + ", but there are " +
                                                     grouped(points) + ", counted from 0");
        }
    }
}

std::int32_t patch_id(std::int64_t label, const std::string& format) {
    if (label != static_cast<std::int32_t>(label)) {
        throw Error(ErrorCode::InvalidInput,
                    format + ": a cell is in patch " + grouped(label) + ", beyond 32 bits");
    }
    return static_cast<std::int32_t>(label);
}

}  // namespace

std::int64_t cell_count(const VtkCells& cells) {
    return cells.offsets.empty() ? 0 : static_cast<std::int64_t>(cells.offsets.size()) - 1;
}

void add_piece(const VtkPiece& piece, const std::string& format, SurfaceBuilder& builder) {
    check(piece, piece.polygons, format);
    check(piece, piece.strips, format);
    const std::int64_t first = builder.vertex_count();
    const auto points = static_cast<std::int64_t>(piece.points.size() / 3);
    builder.reserve(first + points, builder.triangle_count() + cell_count(piece.polygons));
    for (std::size_t i = 0; i + 2 < piece.points.size(); i += 3) {
        builder.add_vertex({piece.points[i], piece.points[i + 1], piece.points[i + 2]});
    }

    auto cell = static_cast<std::size_t>(piece.other_cells);
    std::vector<std::int64_t> corners;
    const auto add = [&](const VtkCells& cells, bool is_strip) {
        for (std::size_t i = 1; i < cells.offsets.size(); ++i, ++cell) {
            corners.assign(cells.corners.begin() + cells.offsets[i - 1],
                           cells.corners.begin() + cells.offsets[i]);
            for (auto& corner : corners) {
                corner += first;
            }
            if (!piece.labels.empty()) {
                builder.begin_patch(patch_id(piece.labels[cell], format));
            }
            if (is_strip) {
                builder.add_strip(corners);
            } else {
                builder.add_face(corners);
            }
        }
    };
    const std::int64_t all =
        piece.other_cells + cell_count(piece.polygons) + cell_count(piece.strips);
    if (!piece.labels.empty() && static_cast<std::int64_t>(piece.labels.size()) != all) {
        throw Error(ErrorCode::InvalidInput, format + ": " + grouped(piece.labels.size()) +
                                                 " values of the patch array for " + grouped(all) +
                                                 " cells");
    }
    add(piece.polygons, false);
    add(piece.strips, true);
}

bool can_be_patches(const std::vector<std::int64_t>& labels) {
    constexpr std::size_t kMostPatches = 65'536;
    std::vector<std::int64_t> distinct = labels;
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
    return !distinct.empty() && distinct.size() <= kMostPatches &&
           2 * distinct.size() <= labels.size() &&
           distinct.front() >= std::numeric_limits<std::int32_t>::min() &&
           distinct.back() <= std::numeric_limits<std::int32_t>::max();
}

}  // namespace remesh::io
