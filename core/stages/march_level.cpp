#include "core/stages/march_level.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "core/parallel.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr int kSecants = 4;
constexpr int kHalf = 1 << 20;  // Grid coordinates fit 21 bits each.

using Cell = std::array<int, 3>;

std::uint64_t key_of(const Cell& cell) {
    std::uint64_t key = 0;
    for (const int x : cell) {
        key = (key << 21U) | static_cast<std::uint64_t>(x + kHalf);
    }
    return key;
}

Cell corner_of(const Cell& cell, std::size_t k) {
    return {cell[0] + static_cast<int>(k & 1U), cell[1] + static_cast<int>((k >> 1U) & 1U),
            cell[2] + static_cast<int>(k >> 2U)};
}

// Six tets around the diagonal from corner 0 to corner 7; alike in neighbouring cells.
constexpr std::array<std::array<std::size_t, 4>, 6> kTets{
    {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};

/// Numbers things by key in the order they come.
class Numbering {
public:
    /// Number of a key, and whether it's new.
    std::pair<std::size_t, bool> add(std::uint64_t key) {
        const auto [entry, is_new] = numbers_.try_emplace(key, numbers_.size());
        return {entry->second, is_new};
    }
    [[nodiscard]] std::size_t of(std::uint64_t key) const { return numbers_.at(key); }
    [[nodiscard]] std::size_t size() const { return numbers_.size(); }

private:
    std::unordered_map<std::uint64_t, std::size_t> numbers_;  // Looked up only, never walked.
};

class Marcher {
public:
    Marcher(const LevelField& field, const Bvh& skin, const std::vector<char>& on_rim,
            const MarchOptions& options, RunContext& run)
        : field_(field), skin_(skin), on_rim_(on_rim), options_(options), run_(run) {}

    /// False if there would be too many cells, or the level leaves the bounds.
    bool march(const Points& seeds) {
        for (const Vec3& seed : seeds) {
            if (!visit_around(seed)) {
                return false;
            }
        }
        std::vector<Cell> front;
        while (!next_.empty()) {
            front.swap(next_);
            next_.clear();
            evaluate_corners(front);
            const std::size_t first = patches_.triangles.size();
            std::vector<std::pair<Cell, std::size_t>> ends;  // Triangles of a cell end here.
            for (const Cell& cell : front) {
                polygonize(cell);
                ends.emplace_back(cell, patches_.triangles.size());
            }
            place_vertices();
            if (!grow(first, ends) || cells_.size() > options_.max_cells) {
                return false;
            }
        }
        return true;
    }

    SurfaceMesh take_patches() {
        std::erase_if(patches_.triangles, [&](const Triangle& t) {
            const Vec3& a = patches_.vertices[static_cast<std::size_t>(t[0])];
            const Vec3& b = patches_.vertices[static_cast<std::size_t>(t[1])];
            const Vec3& c = patches_.vertices[static_cast<std::size_t>(t[2])];
            return !((b - a).cross(c - a).norm() > 1e-12 * options_.cell * options_.cell);
        });
        return std::move(patches_);
    }

private:
    [[nodiscard]] Vec3 position(const Cell& node) const {
        return options_.origin + options_.cell * Vec3(node[0], node[1], node[2]);
    }

    bool visit(const Cell& cell) {
        if (cells_.add(key_of(cell)).second) {
            next_.push_back(cell);
        }
        return cells_.size() <= options_.max_cells;
    }

    bool visit_around(const Vec3& seed) {
        const Vec3 at = (seed - options_.origin) / options_.cell;
        Cell middle;
        for (std::size_t d = 0; d < 3; ++d) {
            const double x = std::floor(at[static_cast<Eigen::Index>(d)]);
            if (!(std::abs(x) < kHalf - 8)) {
                return false;
            }
            middle[d] = static_cast<int>(x);
        }
        for (int dx = -1; dx <= 1; ++dx) {
            for (int dy = -1; dy <= 1; ++dy) {
                for (int dz = -1; dz <= 1; ++dz) {
                    if (!visit({middle[0] + dx, middle[1] + dy, middle[2] + dz})) {
                        return false;
                    }
                }
            }
        }
        return true;
    }

    void evaluate_corners(const std::vector<Cell>& front) {
        const std::size_t known = value_.size();
        std::vector<Cell> fresh;
        for (const Cell& cell : front) {
            for (std::size_t k = 0; k < 8; ++k) {
                const Cell node = corner_of(cell, k);
                if (nodes_.add(key_of(node)).second) {
                    fresh.push_back(node);
                }
            }
        }
        value_.resize(nodes_.size());
        for_each_index(fresh.size(), run_, [&](std::size_t i) {
            value_[known + i] = field_.depth(position(fresh[i]));
        });
    }

    [[nodiscard]] bool is_inside(const Cell& node) const {
        return value_[nodes_.of(key_of(node))] >= 0.0;
    }

    void polygonize(const Cell& cell) {
        std::array<bool, 8> inside;
        for (std::size_t k = 0; k < 8; ++k) {
            inside[k] = is_inside(corner_of(cell, k));
        }
        if (std::all_of(inside.begin(), inside.end(), [&](bool x) { return x == inside[0]; })) {
            return;
        }
        for (const auto& tet : kTets) {
            polygonize_tet(cell, tet, inside);
        }
    }

    void polygonize_tet(const Cell& cell, const std::array<std::size_t, 4>& tet,
                        const std::array<bool, 8>& inside) {
        std::array<std::size_t, 4> in{};
        std::array<std::size_t, 4> out{};
        std::size_t n = 0;
        std::size_t m = 0;
        Vec3 outward = Vec3::Zero();
        for (const std::size_t k : tet) {
            if (inside[k]) {
                in[n++] = k;
            } else {
                out[m++] = k;
            }
        }
        for (std::size_t k = 0; k < n; ++k) {
            outward -= position(corner_of(cell, in[k])) / static_cast<double>(n);
        }
        for (std::size_t k = 0; k < m; ++k) {
            outward += position(corner_of(cell, out[k])) / static_cast<double>(m);
        }
        const auto v = [&](std::size_t i, std::size_t o) {
            return vertex_between(corner_of(cell, in[i]), corner_of(cell, out[o]));
        };
        if (n == 1) {
            add({v(0, 0), v(0, 1), v(0, 2)}, outward);
        } else if (n == 3) {
            add({v(0, 0), v(1, 0), v(2, 0)}, outward);
        } else if (n == 2) {
            add({v(0, 0), v(0, 1), v(1, 1)}, outward);
            add({v(0, 0), v(1, 1), v(1, 0)}, outward);
        }
    }

    Index vertex_between(const Cell& in, const Cell& out) {
        const std::uint64_t a = nodes_.of(key_of(in));
        const std::uint64_t b = nodes_.of(key_of(out));
        const auto [number, is_new] = crossings_.add((std::min(a, b) << 32U) | std::max(a, b));
        if (is_new) {
            ends_.emplace_back(in, out);
        }
        return static_cast<Index>(number);
    }

    void add(const Triangle& triangle, const Vec3& outward) {
        patches_.triangles.push_back(triangle);
        outward_.push_back(outward);
    }

    /// Where the level lies between two nodes: regula falsi, with the Illinois rule against its
    /// slowness.
    [[nodiscard]] Vec3 crossing(const std::pair<Cell, Cell>& ends) const {
        const Vec3 start = position(ends.first);
        const Vec3 along = position(ends.second) - start;
        double in = 0.0;
        double out = 1.0;
        double w_in = value_[nodes_.of(key_of(ends.first))];
        double w_out = value_[nodes_.of(key_of(ends.second))];
        int last = 0;
        for (int k = 0; k < kSecants; ++k) {
            const double t = in + (out - in) * w_in / (w_in - w_out);
            const double w = field_.depth(start + t * along);
            const int side = w >= 0.0 ? 1 : -1;
            (side > 0 ? in : out) = t;
            (side > 0 ? w_in : w_out) = w;
            if (side == last) {  // The other end has stood still twice: let it count for less.
                (side > 0 ? w_out : w_in) *= 0.5;
            }
            last = side;
        }
        const double t = in + (out - in) * w_in / (w_in - w_out);
        return start + t * along;
    }

    void place_vertices() {
        const std::size_t placed = patches_.vertices.size();
        patches_.vertices.resize(ends_.size());
        for_each_index(ends_.size() - placed, run_, [&](std::size_t i) {
            patches_.vertices[placed + i] = crossing(ends_[placed + i]);
        });
    }

    [[nodiscard]] bool is_covered(const Vec3& point) const {
        const double gap2 = options_.gap * options_.gap;
        const double far_gap2 = std::max(gap2, options_.far_gap * options_.far_gap);
        const auto nearest = skin_.closest(point, far_gap2);
        return nearest &&
               (nearest->distance2 < gap2 ||
                (!on_rim_.empty() && on_rim_[static_cast<std::size_t>(nearest->triangle)] == 0));
    }

    [[nodiscard]] bool is_in_bounds(const Vec3& point) const {
        return !options_.bounds || ((point.array() >= options_.bounds->low.array()).all() &&
                                    (point.array() <= options_.bounds->high.array()).all());
    }

    /// Drops new triangles that the skin covers already; cells that keep one go on growing. False
    /// if one is out of bounds.
    bool grow(std::size_t first, const std::vector<std::pair<Cell, std::size_t>>& ends) {
        std::vector<char> is_needed(patches_.triangles.size() - first);
        for_each_index(is_needed.size(), run_, [&](std::size_t i) {
            is_needed[i] = !is_covered(centroid(patches_, first + i));
        });
        std::size_t kept = first;
        std::size_t i = first;
        for (const auto& [cell, end] : ends) {
            const std::size_t before = kept;
            for (; i < end; ++i) {
                if (is_needed[i - first]) {
                    if (!is_in_bounds(centroid(patches_, i))) {
                        return false;
                    }
                    Triangle t = patches_.triangles[i];
                    if (area_vector(patches_, i).dot(outward_[i]) < 0.0) {
                        std::swap(t[1], t[2]);
                    }
                    patches_.triangles[kept++] = t;
                }
            }
            if (kept > before) {
                for (std::size_t d = 0; d < 3; ++d) {
                    for (const int step : {-1, 1}) {
                        Cell neighbour = cell;
                        neighbour[d] += step;
                        visit(neighbour);
                    }
                }
            }
        }
        patches_.triangles.resize(kept);
        outward_.resize(kept);
        return true;
    }

    const LevelField& field_;
    const Bvh& skin_;
    const std::vector<char>& on_rim_;
    const MarchOptions& options_;
    RunContext& run_;
    Numbering cells_;
    Numbering nodes_;
    Numbering crossings_;
    std::vector<Cell> next_;
    std::vector<double> value_;                // Of each node.
    std::vector<std::pair<Cell, Cell>> ends_;  // Inner and outer node of each vertex.
    SurfaceMesh patches_;
    Points outward_;  // Of each triangle, roughly.
};

}  // namespace

std::optional<SurfaceMesh> march_level(const LevelField& field, const Bvh& skin,
                                       const std::vector<char>& on_rim, const Points& seeds,
                                       const MarchOptions& options, RunContext& run) {
    Marcher marcher(field, skin, on_rim, options, run);
    if (!marcher.march(seeds)) {
        return std::nullopt;
    }
    return marcher.take_patches();
}

}  // namespace remesh
