#include "core/stages/close_holes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "core/geometry/bvh.h"
#include "core/geometry/edge_table.h"
#include "core/parallel.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr std::size_t kMaxCells = 500'000;
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
    Marcher(const WindingNumber& winding, const Bvh& skin, const Vec3& origin, double cell,
            double gap, RunContext& run)
        : winding_(winding), skin_(skin), origin_(origin), cell_(cell), gap_(gap), run_(run) {}

    /// False if there would be too many cells.
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
            grow(first, ends);
            if (cells_.size() > kMaxCells) {
                return false;
            }
        }
        return true;
    }

    SurfaceMesh take_patches() { return std::move(patches_); }

private:
    [[nodiscard]] Vec3 position(const Cell& node) const {
        return origin_ + cell_ * Vec3(node[0], node[1], node[2]);
    }

    bool visit(const Cell& cell) {
        if (cells_.add(key_of(cell)).second) {
            next_.push_back(cell);
        }
        return cells_.size() <= kMaxCells;
    }

    bool visit_around(const Vec3& seed) {
        const Vec3 at = (seed - origin_) / cell_;
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
            value_[known + i] = winding_.at(position(fresh[i])) - 0.5;
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

    /// Where w = 1/2 between two nodes: regula falsi, with the Illinois rule against its slowness.
    [[nodiscard]] Vec3 crossing(const std::pair<Cell, Cell>& ends) const {
        const Vec3 start = position(ends.first);
        const Vec3 along = position(ends.second) - start;
        double in = 0.0;
        double out = 1.0;
        double w_in = value_[nodes_.of(key_of(ends.first))];
        double w_out = value_[nodes_.of(key_of(ends.second))];
        double t = 0.5;
        int last = 0;
        for (int k = 0; k < kSecants; ++k) {
            t = (in * w_out - out * w_in) / (w_out - w_in);
            const double w = winding_.at(start + t * along) - 0.5;
            const int side = w >= 0.0 ? 1 : -1;
            (side > 0 ? in : out) = t;
            (side > 0 ? w_in : w_out) = w;
            if (side == last) {  // The other end has stood still twice: let it count for less.
                (side > 0 ? w_out : w_in) *= 0.5;
            }
            last = side;
        }
        return start + t * along;
    }

    void place_vertices() {
        const std::size_t placed = patches_.vertices.size();
        patches_.vertices.resize(ends_.size());
        for_each_index(ends_.size() - placed, run_, [&](std::size_t i) {
            patches_.vertices[placed + i] = crossing(ends_[placed + i]);
        });
    }

    /// Drops new triangles that the skin covers already; cells that keep one go on growing.
    void grow(std::size_t first, const std::vector<std::pair<Cell, std::size_t>>& ends) {
        std::vector<char> is_needed(patches_.triangles.size() - first);
        for_each_index(is_needed.size(), run_, [&](std::size_t i) {
            const Vec3 middle = centroid(patches_, first + i);
            is_needed[i] = !skin_.closest(middle, gap_ * gap_).has_value();
        });
        std::size_t kept = first;
        std::size_t i = first;
        for (const auto& [cell, end] : ends) {
            const std::size_t before = kept;
            for (; i < end; ++i) {
                if (is_needed[i - first]) {
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
    }

    const WindingNumber& winding_;
    const Bvh& skin_;
    Vec3 origin_;
    double cell_;
    double gap_;
    RunContext& run_;
    Numbering cells_;
    Numbering nodes_;
    Numbering crossings_;
    std::vector<Cell> next_;
    std::vector<double> value_;                // w - 1/2 of each node.
    std::vector<std::pair<Cell, Cell>> ends_;  // Inner and outer node of each vertex.
    SurfaceMesh patches_;
    Points outward_;  // Of each triangle, roughly.
};

/// Leaves out unused and area-less things, and finds the largest connected patch.
void finish(HoleResult& result) {
    SurfaceMesh& patches = result.patches;
    DisjointSets sets(patches.vertices.size());
    std::vector<double> area(patches.vertices.size(), 0.0);
    std::vector<Vec3> moment(patches.vertices.size(), Vec3::Zero());
    std::erase_if(patches.triangles, [&](const Triangle& t) {
        const Vec3& a = patches.vertices[static_cast<std::size_t>(t[0])];
        const Vec3& b = patches.vertices[static_cast<std::size_t>(t[1])];
        const Vec3& c = patches.vertices[static_cast<std::size_t>(t[2])];
        return !((b - a).cross(c - a).norm() > 1e-12 * result.cell * result.cell);
    });
    for (const Triangle& t : patches.triangles) {
        sets.merge(t[0], t[1]);
        sets.merge(t[1], t[2]);
    }
    for (std::size_t i = 0; i < patches.triangles.size(); ++i) {
        const auto root = static_cast<std::size_t>(sets.find(patches.triangles[i][0]));
        const double a = area_vector(patches, i).norm();
        result.area += a;
        area[root] += a;
        moment[root] += a * centroid(patches, i);
    }
    if (!patches.triangles.empty()) {
        const auto best = std::max_element(area.begin(), area.end());
        result.largest = moment[static_cast<std::size_t>(best - area.begin())] / *best;
    }
}

}  // namespace

HoleResult close_holes(const WindingNumber& winding, const SurfaceMesh& skin, const Points& seeds,
                       const HoleOptions& options, RunContext& run) {
    HoleResult result;
    if (seeds.empty()) {
        return result;
    }
    const Bvh covered(skin.vertices, skin.triangles);
    const Box box = bounding_box(skin.vertices);
    double cell = options.cell;
    double gap = options.gap;
    for (;;) {
        run.checkpoint();
        // An origin that grid planes of a model rarely share.
        const Vec3 origin = box.low - cell * Vec3(2.37, 2.31, 2.43);
        Marcher marcher(winding, covered, origin, cell, gap, run);
        if (marcher.march(seeds)) {
            result.patches = marcher.take_patches();
            result.cell = cell;
            finish(result);
            return result;
        }
        cell *= 2.0;
        gap *= 2.0;
    }
}

}  // namespace remesh
