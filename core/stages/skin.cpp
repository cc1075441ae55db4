#include "core/stages/skin.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "core/parallel.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr double kOffset = 0.1;          // Of h: how far from the triangle w is asked for.
constexpr double kClose = 0.05;          // Of the triangle's size: so near, it fills half the view.
constexpr double kMaxPieces = 2e5;       // Or four a triangle: more are made coarser than h.
constexpr double kSoundTolerance = 0.3;  // How far w may be from 1 behind and 0 in front.

/// Splits triangles at the middles of edges longer than a length, alike from both sides.
class Splitter {
public:
    Splitter(const SurfaceMesh& surface, double length) : length2_(length * length) {
        pieces_.vertices = surface.vertices;
        pieces_.patch_names = surface.patch_names;
        for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
            split(surface.triangles[i], static_cast<Index>(i));
        }
        if (!surface.patch.empty()) {
            pieces_.patch.reserve(parent_.size());
            for (const Index parent : parent_) {
                pieces_.patch.push_back(surface.patch[static_cast<std::size_t>(parent)]);
            }
        }
    }

    [[nodiscard]] SurfaceMesh& pieces() { return pieces_; }
    [[nodiscard]] const std::vector<Index>& parent() const { return parent_; }

private:
    void split(const Triangle& whole, Index parent) {
        stack_.assign(1, whole);
        while (!stack_.empty()) {
            const Triangle t = stack_.back();
            stack_.pop_back();
            std::size_t longest = 0;
            double longest2 = 0.0;
            int too_long = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                const double l2 = (at(t[k]) - at(t[(k + 1) % 3])).squaredNorm();
                too_long += l2 > length2_;
                if (l2 > longest2) {
                    longest2 = l2;
                    longest = k;
                }
            }
            if (too_long == 0) {
                pieces_.triangles.push_back(t);
                parent_.push_back(parent);
            } else if (too_long == 3) {
                const Index a = middle(t[0], t[1]);
                const Index b = middle(t[1], t[2]);
                const Index c = middle(t[2], t[0]);
                stack_.push_back({t[0], a, c});
                stack_.push_back({a, t[1], b});
                stack_.push_back({c, b, t[2]});
                stack_.push_back({a, b, c});
            } else {
                const Index a = middle(t[longest], t[(longest + 1) % 3]);
                stack_.push_back({t[longest], a, t[(longest + 2) % 3]});
                stack_.push_back({a, t[(longest + 1) % 3], t[(longest + 2) % 3]});
            }
        }
    }

    [[nodiscard]] const Vec3& at(Index v) const {
        return pieces_.vertices[static_cast<std::size_t>(v)];
    }

    Index middle(Index a, Index b) {
        const auto low = static_cast<std::uint64_t>(std::min(a, b));
        const auto high = static_cast<std::uint64_t>(std::max(a, b));
        const auto next = static_cast<Index>(pieces_.vertices.size());
        const auto [entry, is_new] = middles_.try_emplace((low << 32U) | high, next);
        if (is_new) {
            pieces_.vertices.push_back(
                0.5 * (at(static_cast<Index>(low)) + at(static_cast<Index>(high))));
        }
        return entry->second;
    }

    double length2_;
    SurfaceMesh pieces_;
    std::vector<Index> parent_;
    std::vector<Triangle> stack_;
    std::unordered_map<std::uint64_t, Index> middles_;  // Looked up only, never walked.
};

double piece_length(const SurfaceMesh& surface, double h) {
    double area = 0.0;
    double most = 0.0;
    for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
        area += area_vector(surface, i).norm();
        for (std::size_t k = 0; k < 3; ++k) {
            most = std::max(
                most, (corner(surface, i, k) - corner(surface, i, (k + 1) % 3)).squaredNorm());
        }
    }
    // Halving leaves pieces of about a quarter of the squared length.
    const double pieces = std::max(kMaxPieces, 4.0 * static_cast<double>(surface.triangles.size()));
    return std::min(std::max(h, std::sqrt(4.0 * area / pieces)), std::sqrt(most));
}

/// The winding number on both sides of a triangle.
struct Sides {
    double behind = 0.0;
    double ahead = 0.0;

    [[nodiscard]] bool are_sound() const {
        return std::abs(behind - 1.0) < kSoundTolerance && std::abs(ahead) < kSoundTolerance;
    }
};

Sides look_at_sides(const SurfaceMesh& surface, const WindingNumber& winding, double h,
                    std::size_t i) {
    const Vec3 middle = centroid(surface, i);
    const Vec3 area = area_vector(surface, i);
    const double size = std::sqrt(area.norm());
    const Vec3 normal = area / (size * size);
    // Close by, all but the triangle's own solid angle is the same on both sides: mostly one look
    // is enough.
    const Vec3 close_by = middle - std::min(kClose * size, kOffset * h) * normal;
    const double own =
        solid_angle(close_by, corner(surface, i, 0), corner(surface, i, 1), corner(surface, i, 2)) /
        (4.0 * std::numbers::pi);
    Sides sides{.behind = winding.at(close_by)};
    sides.ahead = sides.behind - 2.0 * own;
    if (sides.are_sound()) {
        return sides;
    }
    return {.behind = winding.at(middle - kOffset * h * normal),
            .ahead = winding.at(middle + kOffset * h * normal)};
}

}  // namespace

SkinResult find_skin(const SurfaceMesh& surface, const WindingNumber& winding, double h,
                     RunContext& run) {
    Splitter splitter(surface, piece_length(surface, h));
    SurfaceMesh& pieces = splitter.pieces();
    const std::size_t n = pieces.triangles.size();
    std::vector<char> is_skin(n);
    std::vector<char> is_sound(n);
    for_each_index(n, run, [&](std::size_t i) {
        const Sides sides = look_at_sides(pieces, winding, h, i);
        is_skin[i] = (sides.behind >= 0.5) != (sides.ahead >= 0.5);
        is_sound[i] = sides.are_sound();
    });

    SkinResult result;
    std::vector<char> has_skin(surface.triangles.size(), 0);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double area = area_vector(pieces, i).norm();
        if (!is_skin[i]) {
            result.dropped_area += area;
            continue;
        }
        result.area += area;
        result.sound_area += is_sound[i] ? area : 0.0;
        has_skin[static_cast<std::size_t>(splitter.parent()[i])] = 1;
        pieces.triangles[kept] = pieces.triangles[i];
        if (!pieces.patch.empty()) {
            pieces.patch[kept] = pieces.patch[i];
        }
        ++kept;
    }
    result.dropped = std::count(has_skin.begin(), has_skin.end(), 0);
    if (result.dropped > 0) {
        const auto first = std::find(has_skin.begin(), has_skin.end(), 0) - has_skin.begin();
        result.first_dropped = centroid(surface, static_cast<std::size_t>(first));
    }
    if (kept == n) {
        result.surface = surface;
        return result;
    }
    pieces.triangles.resize(kept);
    pieces.patch.resize(pieces.patch.empty() ? 0 : kept);
    result.was_split = n > surface.triangles.size();
    result.surface = std::move(pieces);
    return result;
}

}  // namespace remesh
