#include "core/exact/intersections.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "core/exact/box_tree.h"

namespace remesh {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Segment = Kernel::Segment_3;
using Pair = std::pair<Index, Index>;

constexpr std::size_t kLeavesBetweenCheckpoints = 256;
constexpr double kSurelyNotCollinear = 1e-10;  // Height over longest edge, far above rounding.

Point exact(const Vec3& p) {
    return {p.x(), p.y(), p.z()};
}

class TrianglePairs {
public:
    TrianglePairs(const Points& vertices, const std::vector<Triangle>& triangles)
        : vertices_(vertices), triangles_(triangles) {}

    [[nodiscard]] bool is_proper(const Triangle& t) const {
        const Vec3& a = vertices_[t[0]];
        const Vec3& b = vertices_[t[1]];
        const Vec3& c = vertices_[t[2]];
        if (!a.allFinite() || !b.allFinite() || !c.allFinite()) {
            return false;
        }
        const double longest =
            std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
        return (b - a).cross(c - a).norm() > kSurelyNotCollinear * longest ||
               !CGAL::collinear(exact(a), exact(b), exact(c));
    }

    [[nodiscard]] bool meet(Index first, Index second, bool only_apart) const {
        Triangle s = triangles_[first];
        Triangle t = triangles_[second];
        const std::size_t shared = shared_to_front(s, t);
        if (only_apart && shared > 0) {
            return false;
        }
        switch (shared) {
            case 0: return meet_apart(s, t);
            case 1: return meet_beyond_vertex(s, t);
            case 2: return meet_beyond_edge(s, t);
            default: return true;  // The same triangle twice.
        }
    }

private:
    [[nodiscard]] Point point(Index v) const { return exact(vertices_[v]); }
    [[nodiscard]] Kernel::Triangle_3 triangle(const Triangle& t) const {
        return {point(t[0]), point(t[1]), point(t[2])};
    }
    [[nodiscard]] CGAL::Orientation side(const Triangle& plane, Index v) const {
        return CGAL::orientation(point(plane[0]), point(plane[1]), point(plane[2]), point(v));
    }

    // Puts common vertices first, in the same order in both; returns how many there are.
    static std::size_t shared_to_front(Triangle& s, Triangle& t) {
        std::size_t shared = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            const auto found = std::find(t.begin() + shared, t.end(), s[i]);
            if (found != t.end()) {
                std::swap(t[shared], *found);
                std::swap(s[shared], s[i]);
                ++shared;
            }
        }
        return shared;
    }

    // Whether the last vertices of t, from `first` on, lie strictly on one side of s.
    [[nodiscard]] bool is_beside(const Triangle& s, const Triangle& t, std::size_t first) const {
        const auto reference = side(s, t[first]);
        if (reference == CGAL::COPLANAR) {
            return false;
        }
        for (std::size_t i = first + 1; i < 3; ++i) {
            if (side(s, t[i]) != reference) {
                return false;
            }
        }
        return true;
    }

    [[nodiscard]] bool meet_apart(const Triangle& s, const Triangle& t) const {
        return !is_beside(s, t, 0) && !is_beside(t, s, 0) &&
               CGAL::do_intersect(triangle(s), triangle(t));
    }

    // Beyond the common vertex they only meet where the opposite edge of one meets the other.
    [[nodiscard]] bool meet_beyond_vertex(const Triangle& s, const Triangle& t) const {
        return !is_beside(s, t, 1) && !is_beside(t, s, 1) &&
               (CGAL::do_intersect(Segment(point(s[1]), point(s[2])), triangle(t)) ||
                CGAL::do_intersect(Segment(point(t[1]), point(t[2])), triangle(s)));
    }

    // Beyond the common edge they only meet if one is folded flat onto the other.
    [[nodiscard]] bool meet_beyond_edge(const Triangle& s, const Triangle& t) const {
        return side(s, t[2]) == CGAL::COPLANAR &&
               CGAL::coplanar_orientation(point(s[0]), point(s[1]), point(s[2]), point(t[2])) ==
                   CGAL::POSITIVE;
    }

    const Points& vertices_;
    const std::vector<Triangle>& triangles_;
};

Box box_of(const Points& vertices, const Triangle& triangle) {
    Box box;
    for (const Index v : triangle) {
        box.include(vertices[v]);
    }
    return box;
}

}  // namespace

Crossings find_crossings(const Points& vertices, const std::vector<Triangle>& triangles,
                         const CrossingLimits& limits, const std::function<void()>& checkpoint) {
    checkpoint();
    const TrianglePairs pairs(vertices, triangles);
    std::vector<Index> proper;
    std::vector<Box> boxes;
    proper.reserve(triangles.size());
    boxes.reserve(triangles.size());
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        if (pairs.is_proper(triangles[i])) {
            proper.push_back(static_cast<Index>(i));
            boxes.push_back(box_of(vertices, triangles[i]));
        }
    }

    const BoxTree tree(boxes);
    tbb::enumerable_thread_specific<std::vector<Pair>> found;
    std::atomic<std::size_t> pair_count = 0;
    std::atomic<std::size_t> candidates = 0;
    const auto is_beyond = [&] {
        return pair_count > limits.pairs || candidates > limits.candidates;
    };
    const auto search = [&](std::size_t leaf, std::vector<Pair>& mine) {
        const std::size_t before = mine.size();
        std::size_t looked_at = 0;
        tree.overlaps_from(leaf, [&](Index a, Index b) {
            ++looked_at;
            const auto pair = std::minmax(proper[a], proper[b]);
            if (pairs.meet(pair.first, pair.second, limits.only_apart)) {
                mine.emplace_back(pair);
            }
        });
        pair_count += mine.size() - before;
        candidates += looked_at;
    };
    using Leaves = tbb::blocked_range<std::size_t>;
    tbb::parallel_for(
        Leaves(0, tree.leaves(), kLeavesBetweenCheckpoints),
        [&](const Leaves& some) {
            checkpoint();
            auto& mine = found.local();
            for (std::size_t leaf = some.begin(); leaf != some.end() && !is_beyond(); ++leaf) {
                search(leaf, mine);
            }
        },
        tbb::simple_partitioner());

    Crossings all{.is_complete = !is_beyond()};
    for (const auto& some : found) {
        all.pairs.insert(all.pairs.end(), some.begin(), some.end());
    }
    std::sort(all.pairs.begin(), all.pairs.end());
    return all;
}

std::vector<Pair> self_intersections(const Points& vertices, const std::vector<Triangle>& triangles,
                                     const std::function<void()>& checkpoint) {
    return find_crossings(vertices, triangles, {}, checkpoint).pairs;
}

int orientation_sign(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    return static_cast<int>(CGAL::orientation(exact(a), exact(b), exact(c), exact(d)));
}

}  // namespace remesh
