#include "server/report/picture.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <zlib.h>

#include "core/error.h"
#include "core/mesh/quality.h"

namespace remesh::report {
namespace {

constexpr int kSupersampling = 2;
constexpr double kMargin = 0.03;  // Around the body, over its height.
constexpr int kMaxWidthOverHeight = 2;
// Edges are drawn where triangles are at least this large on average, pixels.
constexpr double kLeastEdge = 5.0;
constexpr double kEdgeShade = 0.66;

using Colour = Eigen::Vector3f;

Colour colour_of(double quality) {
    struct Stop {
        double at;
        Colour colour;
    };
    static const std::array<Stop, 5> stops{{{0.0, {165, 0, 38}},
                                            {0.4, {244, 109, 67}},
                                            {0.7, {254, 224, 144}},
                                            {0.88, {171, 214, 230}},
                                            {1.0, {88, 146, 196}}}};
    const double value = std::clamp(quality, 0.0, 1.0);
    std::size_t i = 1;
    while (i + 1 < stops.size() && stops[i].at < value) {
        ++i;
    }
    const auto share =
        static_cast<float>((value - stops[i - 1].at) / (stops[i].at - stops[i - 1].at));
    return stops[i - 1].colour + share * (stops[i].colour - stops[i - 1].colour);
}

bool is_finite(const std::array<Vec3, 3>& corners) {
    return std::all_of(corners.begin(), corners.end(), [](const Vec3& p) { return p.allFinite(); });
}

/// Colours and depths at a multiple of the final resolution.
class Canvas {
public:
    Canvas(int width, int height)
        : width_(width),
          height_(height),
          colour_(pixels(), Colour::Zero()),
          depth_(pixels(), -std::numeric_limits<float>::infinity()) {}

    /// \param corners  x right and y down in pixels, z towards the eye
    void fill(const std::array<Vec3, 3>& corners, const Colour& colour, double edge_width) {
        const auto& [a, b, c] = corners;
        const double area = cross(a, b, c);
        if (std::abs(area) < 1e-9) {
            return;
        }
        const int left = std::max(0, static_cast<int>(std::floor(std::min({a.x(), b.x(), c.x()}))));
        const int right =
            std::min(width_ - 1, static_cast<int>(std::ceil(std::max({a.x(), b.x(), c.x()}))));
        const int top = std::max(0, static_cast<int>(std::floor(std::min({a.y(), b.y(), c.y()}))));
        const int bottom =
            std::min(height_ - 1, static_cast<int>(std::ceil(std::max({a.y(), b.y(), c.y()}))));
        // Barycentric weights are linear in x and y.
        const std::array<Plane, 3> weights{plane(b, c, area), plane(c, a, area), plane(a, b, area)};
        const std::array<double, 3> heights{std::abs(area) / length(b, c),
                                            std::abs(area) / length(c, a),
                                            std::abs(area) / length(a, b)};
        for (int y = top; y <= bottom; ++y) {
            for (int x = left; x <= right; ++x) {
                const double u = weights[0].at(x + 0.5, y + 0.5);
                const double v = weights[1].at(x + 0.5, y + 0.5);
                const double w = weights[2].at(x + 0.5, y + 0.5);
                if (u < 0.0 || v < 0.0 || w < 0.0) {
                    continue;
                }
                const auto z = static_cast<float>(u * a.z() + v * b.z() + w * c.z());
                const std::size_t at = index(x, y);
                if (z > depth_[at]) {
                    const bool is_edge =
                        std::min({u * heights[0], v * heights[1], w * heights[2]}) < edge_width;
                    depth_[at] = z;
                    colour_[at] =
                        is_edge ? Colour(colour * static_cast<float>(kEdgeShade)) : colour;
                }
            }
        }
    }

    /// Rows of RGBA, averaged, each with PNG's filter byte before it.
    [[nodiscard]] std::string rows() const {
        const int width = width_ / kSupersampling;
        const int height = height_ / kSupersampling;
        std::string bytes;
        bytes.reserve(static_cast<std::size_t>(height) * (4 * static_cast<std::size_t>(width) + 1));
        for (int y = 0; y < height; ++y) {
            bytes += '\0';
            for (int x = 0; x < width; ++x) {
                append_pixel(x, y, bytes);
            }
        }
        return bytes;
    }

private:
    [[nodiscard]] std::size_t pixels() const {
        return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
    }
    [[nodiscard]] std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
               static_cast<std::size_t>(x);
    }
    struct Plane {
        double dx = 0.0;
        double dy = 0.0;
        double offset = 0.0;

        [[nodiscard]] double at(double x, double y) const { return dx * x + dy * y + offset; }
    };

    /// cross(p, q, .) / area
    static Plane plane(const Vec3& p, const Vec3& q, double area) {
        const double dx = -(q.y() - p.y()) / area;
        const double dy = (q.x() - p.x()) / area;
        return {dx, dy, -dx * p.x() - dy * p.y()};
    }
    static double cross(const Vec3& a, const Vec3& b, const Vec3& c) {
        return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
    }
    static double length(const Vec3& a, const Vec3& b) {
        return std::max(1e-9, std::hypot(b.x() - a.x(), b.y() - a.y()));
    }

    void append_pixel(int x, int y, std::string& bytes) const {
        Colour sum = Colour::Zero();
        int covered = 0;
        for (int dy = 0; dy < kSupersampling; ++dy) {
            for (int dx = 0; dx < kSupersampling; ++dx) {
                const std::size_t at = index(x * kSupersampling + dx, y * kSupersampling + dy);
                if (std::isfinite(depth_[at])) {
                    sum += colour_[at];
                    ++covered;
                }
            }
        }
        const auto byte = [](float value) {
            return static_cast<char>(
                static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L)));
        };
        for (int i = 0; i < 3; ++i) {
            bytes += covered > 0 ? byte(sum[i] / static_cast<float>(covered)) : '\0';
        }
        bytes += byte(255.0F * static_cast<float>(covered) / (kSupersampling * kSupersampling));
    }

    int width_;
    int height_;
    std::vector<Colour> colour_;
    std::vector<float> depth_;
};

void append_word(std::uint32_t word, std::string& bytes) {
    for (int shift = 24; shift >= 0; shift -= 8) {
        bytes += static_cast<char>(static_cast<std::uint8_t>(word >> static_cast<unsigned>(shift)));
    }
}

void append_chunk(std::string_view kind, const std::string& data, std::string& png) {
    append_word(static_cast<std::uint32_t>(data.size()), png);
    const std::string body = std::string(kind) + data;
    png += body;
    append_word(static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(body.data()),
                                                 static_cast<uInt>(body.size()))),
                png);
}

std::string png_of(const std::string& rows, int width, int height) {
    uLongf size = compressBound(static_cast<uLong>(rows.size()));
    std::string packed(size, '\0');
    if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                  reinterpret_cast<const Bytef*>(rows.data()), static_cast<uLong>(rows.size()),
                  Z_DEFAULT_COMPRESSION) != Z_OK) {
        throw Error(ErrorCode::Internal, "zlib can't compress a picture");
    }
    packed.resize(size);
    std::string header;
    append_word(static_cast<std::uint32_t>(width), header);
    append_word(static_cast<std::uint32_t>(height), header);
    header += std::string("\x08\x06\x00\x00\x00", 5);  // 8 bits, RGBA, not interlaced
    std::string png("\x89PNG\r\n\x1a\n", 8);
    append_chunk("IHDR", header, png);
    append_chunk("IDAT", packed, png);
    append_chunk("IEND", {}, png);
    return png;
}

}  // namespace

Facets facets_of(const SurfaceMesh& surface) {
    Facets facets;
    for (const Triangle& triangle : surface.triangles) {
        const auto corner = [&](std::size_t i) {
            return surface.vertices[static_cast<std::size_t>(triangle[i])];
        };
        const std::array<Vec3, 3> corners{corner(0), corner(1), corner(2)};
        if (is_finite(corners)) {
            facets.corners.push_back(corners);
            facets.quality.push_back(triangle_radius_ratio(corners[0], corners[1], corners[2]));
        }
    }
    return facets;
}

Facets half_of(const TetMesh& mesh, const View& view) {
    const double middle = 0.5 * (view.low.z() + view.high.z());
    std::vector<Tet> kept;
    for (const Tet& tet : mesh.tets) {
        Vec3 sum = Vec3::Zero();
        for (const Index v : tet) {
            sum += mesh.vertices[static_cast<std::size_t>(v)];
        }
        if (view.turn.row(2).dot(0.25 * sum) <= middle) {
            kept.push_back(tet);
        }
    }
    std::vector<Index> owner;
    const std::vector<Triangle> boundary = boundary_of(kept, &owner);
    Facets facets;
    for (std::size_t i = 0; i < boundary.size(); ++i) {
        const auto corner = [&](Index v) { return mesh.vertices[static_cast<std::size_t>(v)]; };
        const auto& [a, b, c] = boundary[i];
        const auto& [p, q, r, s] = kept[static_cast<std::size_t>(owner[i])];
        facets.corners.push_back({corner(a), corner(b), corner(c)});
        facets.quality.push_back(tet_radius_ratio(corner(p), corner(q), corner(r), corner(s)));
    }
    return facets;
}

View upright_view(const Facets& body) {
    Vec3 mean = Vec3::Zero();
    for (const auto& corners : body.corners) {
        mean += (corners[0] + corners[1] + corners[2]) / 3.0;
    }
    mean /= static_cast<double>(std::max<std::size_t>(1, body.corners.size()));
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const auto& corners : body.corners) {
        const Vec3 offset = (corners[0] + corners[1] + corners[2]) / 3.0 - mean;
        spread += offset * offset.transpose();
    }
    View view;
    // Eigenvalues rise: the last axis is the longest.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
    Vec3 up = axes.eigenvectors().col(2);
    // Of both directions the one that goes up in the model: its largest part is positive.
    Eigen::Index largest = 0;
    up.cwiseAbs().maxCoeff(&largest);
    up *= up[largest] < 0.0 ? -1.0 : 1.0;
    Vec3 right = axes.eigenvectors().col(1);
    right.cwiseAbs().maxCoeff(&largest);
    right *= right[largest] < 0.0 ? -1.0 : 1.0;
    view.turn.row(0) = right;
    view.turn.row(1) = up;
    view.turn.row(2) = right.cross(up);
    Box box;
    for (const auto& corners : body.corners) {
        for (const Vec3& corner : corners) {
            box.include(view.turn * corner);
        }
    }
    if (!box.is_empty()) {
        const Vec3 margin = Vec3::Constant(kMargin * (box.high.y() - box.low.y()));
        view.low = box.low - margin;
        view.high = box.high + margin;
    }
    return view;
}

std::string draw_png(const Facets& facets, const View& view, int height) {
    const Vec3 extent = (view.high - view.low).cwiseMax(1e-12);
    const double ratio = std::min<double>(extent.x() / extent.y(), kMaxWidthOverHeight);
    const int width = std::max(1, static_cast<int>(std::lround(height * ratio)));
    const double scale = kSupersampling * height / extent.y();

    double edges = 0.0;
    for (const auto& corners : facets.corners) {
        edges += (corners[1] - corners[0]).norm();
    }
    edges *= scale / static_cast<double>(std::max<std::size_t>(1, facets.corners.size()));
    const double edge_width = edges / kSupersampling >= kLeastEdge ? 0.45 * kSupersampling : 0.0;

    const Vec3 light = Vec3(-0.35, 0.45, 0.82).normalized();
    Canvas canvas(width * kSupersampling, height * kSupersampling);
    for (std::size_t i = 0; i < facets.corners.size(); ++i) {
        std::array<Vec3, 3> seen;
        for (std::size_t k = 0; k < 3; ++k) {
            seen[k] = view.turn * facets.corners[i][k];
        }
        const Vec3 normal = (seen[1] - seen[0]).cross(seen[2] - seen[0]);
        const double length = normal.norm();
        // Damaged surfaces have no outside: both sides are lit.
        const double lit = length > 0.0 ? std::abs(normal.dot(light)) / length : 1.0;
        for (Vec3& p : seen) {
            p = Vec3(scale * (p.x() - view.low.x()), scale * (view.high.y() - p.y()), p.z());
        }
        canvas.fill(seen, colour_of(facets.quality[i]) * static_cast<float>(0.45 + 0.55 * lit),
                    edge_width);
    }
    return png_of(canvas.rows(), width, height);
}

}  // namespace remesh::report
