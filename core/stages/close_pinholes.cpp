#include "core/stages/close_pinholes.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "core/geometry/edge_table.h"
#include "core/stages/rims.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr double kMostRadius = 1.5;     // Of h: wider holes want to be filled smoothly.
constexpr std::size_t kMostEdges = 64;  // Of a rim: the cost grows with the third power.
constexpr double kMostShare = 0.25;     // Of a piece's area that its hole may have.
constexpr double kSlit = 0.02;          // Area over length squared: a slit faces no way.
constexpr double kLeastHeight = 1e-9;   // Of the longest edge: thinner triangles are left out.

using HalfEdge = EdgeTable::HalfEdge;
using Loop = std::vector<HalfEdge>;  ///< Half-edges of the surface, in the order of the hole.

/// Walks along open edges, the surface's half-edges backwards, and takes off a loop wherever the
/// walk comes back to a vertex.
class LoopWalk {
public:
    LoopWalk(const SurfaceMesh& surface, const EdgeTable& table) : surface_(surface) {
        for (const auto& edge : table.edges()) {
            if (edge.count == 1) {
                open_.push_back(table.half_edges(edge)[0]);
            }
        }
        // By the vertex where the hole's edge starts: the end of the surface's.
        std::sort(open_.begin(), open_.end(), [&](HalfEdge a, HalfEdge b) {
            const auto x = end_of(surface.triangles, a);
            const auto y = end_of(surface.triangles, b);
            return x != y ? x < y : a < b;
        });
        used_.assign(open_.size(), 0);
        place_.assign(surface.vertices.size(), kNone);
    }

    std::vector<Loop> loops() {
        for (std::size_t first = 0; first < open_.size(); ++first) {
            if (!used_[first]) {
                walk(first);
            }
        }
        return std::move(loops_);
    }

private:
    [[nodiscard]] Index from(HalfEdge half) const { return end_of(surface_.triangles, half); }
    [[nodiscard]] Index to(HalfEdge half) const { return start_of(surface_.triangles, half); }
    Index& place(Index vertex) { return place_[static_cast<std::size_t>(vertex)]; }
    [[nodiscard]] const Vec3& at(Index vertex) const {
        return surface_.vertices[static_cast<std::size_t>(vertex)];
    }

    void walk(std::size_t first) {
        std::vector<HalfEdge> path;
        for (std::size_t next = first; next != open_.size();) {
            const HalfEdge half = open_[next];
            used_[next] = 1;
            place(from(half)) = static_cast<Index>(path.size());
            path.push_back(half);
            if (place(to(half)) != kNone) {
                take_loop(path, static_cast<std::size_t>(place(to(half))));
            }
            next = go_on(half);
        }
        for (const HalfEdge half : path) {
            place(from(half)) = kNone;
        }
    }

    void take_loop(std::vector<HalfEdge>& path, std::size_t start) {
        const auto begin = path.begin() + static_cast<std::ptrdiff_t>(start);
        for (auto it = begin; it != path.end(); ++it) {
            place(from(*it)) = kNone;
        }
        loops_.emplace_back(begin, path.end());
        path.erase(begin, path.end());
    }

    /// Of the edges that go on, the one that turns back most: where holes touch in a vertex, each
    /// keeps to itself.
    [[nodiscard]] std::size_t go_on(HalfEdge half) const {
        const Index middle = to(half);
        const Vec3 back = (at(from(half)) - at(middle)).normalized();
        auto it = std::lower_bound(open_.begin(), open_.end(), middle,
                                   [&](HalfEdge a, Index vertex) { return from(a) < vertex; });
        std::size_t best = open_.size();
        double most = -std::numeric_limits<double>::infinity();
        for (; it != open_.end() && from(*it) == middle; ++it) {
            const auto i = static_cast<std::size_t>(it - open_.begin());
            const double cosine = back.dot((at(to(*it)) - at(middle)).normalized());
            if (!used_[i] && cosine > most) {
                most = cosine;
                best = i;
            }
        }
        return best;
    }

    const SurfaceMesh& surface_;
    std::vector<HalfEdge> open_;
    std::vector<char> used_;    // #open_
    std::vector<Index> place_;  // #V: where on the present path, or kNone.
    std::vector<Loop> loops_;
};

/// The triangulation of a polygon with the least area.
class LeastArea {
public:
    explicit LeastArea(const Points& polygon) : polygon_(polygon), n_(polygon.size()) {
        cost_.assign(n_ * n_, 0.0);
        apex_.assign(n_ * n_, 0);
        for (std::size_t width = 2; width < n_; ++width) {
            for (std::size_t i = 0; i + width < n_; ++i) {
                decide(i, i + width);
            }
        }
        collect(0, n_ - 1);
    }

    [[nodiscard]] double area() const { return cost_[n_ - 1]; }
    [[nodiscard]] const std::vector<std::array<std::size_t, 3>>& triangles() const {
        return triangles_;
    }

private:
    void decide(std::size_t i, std::size_t k) {
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t j = i + 1; j < k; ++j) {
            const Vec3 normal = (polygon_[j] - polygon_[i]).cross(polygon_[k] - polygon_[i]);
            const double cost = cost_[i * n_ + j] + cost_[j * n_ + k] + 0.5 * normal.norm();
            if (cost < least) {
                least = cost;
                apex_[i * n_ + k] = j;
            }
        }
        cost_[i * n_ + k] = least;
    }

    void collect(std::size_t i, std::size_t k) {
        if (k - i < 2) {
            return;
        }
        const std::size_t j = apex_[i * n_ + k];
        triangles_.push_back({i, j, k});
        collect(i, j);
        collect(j, k);
    }

    const Points& polygon_;
    std::size_t n_;
    std::vector<double> cost_;       // Of the part between two corners.
    std::vector<std::size_t> apex_;  // Of the triangle over the line between them.
    std::vector<std::array<std::size_t, 3>> triangles_;
};

class PinholeCloser {
public:
    PinholeCloser(const SurfaceMesh& surface, double h, RunContext& run)
        : surface_(surface),
          h_(h),
          run_(run),
          table_(surface.triangles, surface.vertices.size()),
          pieces_(surface.triangles.size()),
          piece_area_(surface.triangles.size(), 0.0) {}

    PinholeResult close() {
        measure_pieces();
        double longest = 0.0;
        std::size_t covered = 0;
        for (const Loop& loop : LoopWalk(surface_, table_).loops()) {
            run_.checkpoint();
            if (loop.size() < 3 || loop.size() > kMostEdges) {
                continue;
            }
            const Rim rim = rim_of(surface_, loop);
            if (rim.radius < kMostRadius * h_ && span(loop, rim)) {
                covered += loop.size();
                ++result_.closed;
                if (rim.length > longest) {
                    longest = rim.length;
                    result_.largest = rim.center;
                }
            }
        }
        result_.is_watertight = covered == odd_edges();
        return std::move(result_);
    }

private:
    void measure_pieces() {
        for (const auto& edge : table_.edges()) {
            const auto halves = table_.half_edges(edge);
            for (const HalfEdge half : halves) {
                pieces_.merge(static_cast<Index>(EdgeTable::triangle_of(halves[0])),
                              static_cast<Index>(EdgeTable::triangle_of(half)));
            }
        }
        for (std::size_t i = 0; i < surface_.triangles.size(); ++i) {
            piece_area_[piece_of(i)] += area_vector(surface_, i).norm();
        }
    }

    std::size_t piece_of(std::size_t triangle) {
        return static_cast<std::size_t>(pieces_.find(static_cast<Index>(triangle)));
    }

    [[nodiscard]] std::size_t odd_edges() const {
        const auto& edges = table_.edges();
        return static_cast<std::size_t>(std::count_if(
            edges.begin(), edges.end(), [](const auto& edge) { return edge.count % 2 == 1; }));
    }

    /// \return whether it is a hole
    bool span(const Loop& loop, const Rim& rim) {
        Points corners;
        double piece = 0.0;
        for (const HalfEdge half : loop) {
            const Index v = end_of(surface_.triangles, half);
            corners.push_back(surface_.vertices[static_cast<std::size_t>(v)]);
            piece = std::max(piece, piece_area_[piece_of(EdgeTable::triangle_of(half))]);
        }
        const LeastArea spanned(corners);
        const bool is_slit = spanned.area() < kSlit * rim.length * rim.length;
        if (spanned.area() > kMostShare * piece || !(rim.is_hole() || is_slit)) {
            return false;
        }
        bool is_whole = true;
        for (const auto& [a, b, c] : spanned.triangles()) {
            is_whole =
                add({end_of(surface_.triangles, loop[a]), end_of(surface_.triangles, loop[b]),
                     end_of(surface_.triangles, loop[c])},
                    EdgeTable::triangle_of(loop[a])) &&
                is_whole;
        }
        result_.area += spanned.area();
        return is_whole;
    }

    /// \return whether the triangle has a direction
    bool add(const Triangle& triangle, std::size_t beside) {
        const auto at = [&](std::size_t k) -> const Vec3& {
            return surface_.vertices[static_cast<std::size_t>(triangle[k])];
        };
        const Vec3 u = at(1) - at(0);
        const Vec3 v = at(2) - at(0);
        const double longest2 = std::max({u.squaredNorm(), v.squaredNorm(), (u - v).squaredNorm()});
        if (!(u.cross(v).norm() > kLeastHeight * longest2)) {
            return false;
        }
        result_.triangles.push_back(triangle);
        if (!surface_.patch.empty()) {
            result_.patch.push_back(surface_.patch[beside]);
        }
        return true;
    }

    const SurfaceMesh& surface_;
    double h_;
    RunContext& run_;
    EdgeTable table_;
    DisjointSets pieces_;
    std::vector<double> piece_area_;  // By a piece's first triangle.
    PinholeResult result_;
};

}  // namespace

PinholeResult close_pinholes(const SurfaceMesh& surface, double h, RunContext& run) {
    return PinholeCloser(surface, h, run).close();
}

}  // namespace remesh
