#include "core/stages/improve/ring.h"

#include <algorithm>

namespace remesh::improve {
namespace {

// Corners c and d of a tet, so that (a, b, c, d) is positively oriented.
std::array<Index, 2> rest_of(const Tet& tet, Index a, Index b) {
    std::size_t ia = 0;
    while (tet[ia] != a) {
        ++ia;
    }
    const auto& order = kToFront[ia];
    for (std::size_t k = 1; k < 4; ++k) {
        if (tet[order[k]] == b) {
            return {tet[order[k % 3 + 1]], tet[order[(k + 1) % 3 + 1]]};
        }
    }
    return {kNone, kNone};
}

}  // namespace

std::optional<Ring> ring_around(const LiveMesh& mesh, Index a, Index b) {
    std::array<Index, kMaxRing> tets{};
    std::array<std::array<Index, 2>, kMaxRing> sides{};
    std::size_t n = 0;
    for (const Index t : mesh.around(a)) {
        if (!has(mesh.tet(t), b)) {
            continue;
        }
        if (n == kMaxRing) {
            return std::nullopt;
        }
        tets[n] = t;
        sides[n++] = rest_of(mesh.tet(t), a, b);
    }
    if (n == 0) {
        return std::nullopt;
    }
    std::size_t current = n;
    for (std::size_t i = 0; i < n; ++i) {
        const bool has_previous = std::any_of(sides.begin(), sides.begin() + n,
                                              [&](auto& side) { return side[1] == sides[i][0]; });
        if (!has_previous) {
            if (current != n) {
                return std::nullopt;  // Two fans: the edge isn't manifold.
            }
            current = i;
        }
    }
    const bool is_open = current != n;
    Ring ring;
    ring.tet_count = n;
    current = is_open ? current : 0;
    for (std::size_t step = 0; step < n; ++step) {
        ring.tets[step] = tets[current];
        ring.vertices[ring.size++] = sides[current][0];
        const Index to = sides[current][1];
        std::size_t next = 0;
        while (next < n && sides[next][0] != to) {
            ++next;
        }
        if (step + 1 == n) {
            if (is_open ? next != n : to != ring.vertices[0]) {
                return std::nullopt;
            }
            if (is_open) {
                ring.vertices[ring.size++] = to;
            }
        } else if (next == n) {
            return std::nullopt;
        }
        current = next;
    }
    if (ring.size > kMaxRing) {
        return std::nullopt;
    }
    return ring;
}

}  // namespace remesh::improve
