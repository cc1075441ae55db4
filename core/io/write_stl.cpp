#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <string>

#include "core/error.h"
#include "core/io/output.h"
#include "core/io/writers.h"
#include "core/number_text.h"

namespace remesh::io {
namespace {

// Adding 0 turns -0 into 0: readers that weld by bytes would tear a surface apart at x = 0.
float single(double value) {
    if (std::abs(value) > double{std::numeric_limits<float>::max()} && std::isfinite(value)) {
        throw Error(ErrorCode::InvalidInput,
                    "STL holds single precision, in which the coordinate " + number_text(value) +
                        " doesn't fit");
    }
    return static_cast<float>(value) + 0.0F;
}

}  // namespace

void write_stl(const SurfaceMesh& surface, std::ostream& out) {
    constexpr bool kSwap = must_swap(std::endian::little);
    Output output(out);
    std::string header = "binary STL, written by remesh";  // Mustn't begin with "solid".
    header.resize(80, ' ');
    output << header;
    output.put(static_cast<std::uint32_t>(surface.triangles.size()), kSwap);
    for (const auto& triangle : surface.triangles) {
        std::array<Vec3, 3> corners;
        for (std::size_t i = 0; i < 3; ++i) {
            corners[i] = surface.vertices[static_cast<std::size_t>(triangle[i])];
        }
        const Vec3 area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        const double length = area.norm();
        const Vec3 normal = length > 0 ? Vec3(area / length) : Vec3::Zero();
        for (const Vec3& v : {normal, corners[0], corners[1], corners[2]}) {
            output.put(single(v.x()), kSwap);
            output.put(single(v.y()), kSwap);
            output.put(single(v.z()), kSwap);
        }
        output.put(std::uint16_t{0}, kSwap);
    }
}

}  // namespace remesh::io
