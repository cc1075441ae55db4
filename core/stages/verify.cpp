#include "core/stages/verify.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <compare>
#include <cstddef>
#include <numeric>
#include <span>
#include <utility>

#include "core/exact/intersections.h"
#include "core/mesh/tet_corners.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kDegenerateHeight = 1e-9;  // Of the longest edge.
constexpr double kFlatVolume = 1e-12;       // 6 V over the longest edge cubed.

// Rows grouped by their smallest vertex: `start[v]` is the first row of vertex v. What sorting by
// all vertices would give, but linear, since a vertex has only a few rows.
template <typename Row>
struct RowTable {
    std::vector<std::uint32_t> start{};
    std::vector<Row> rows{};
};

// `emit(i, add)` calls `add(smallest vertex, row)` for all rows of element i.
template <typename Row, typename Emit>
RowTable<Row> tabulate(std::size_t vertices, std::size_t elements, const RunContext& run,
                       const Emit& emit) {
    RowTable<Row> table;
    table.start.assign(vertices + 1, 0);
    for (std::size_t i = 0; i < elements; ++i) {
        emit(i, [&](Index v, const Row&) { ++table.start[v + 1]; });
    }
    run.checkpoint();
    std::partial_sum(table.start.begin(), table.start.end(), table.start.begin());
    table.rows.resize(table.start.back());
    auto next = table.start;
    for (std::size_t i = 0; i < elements; ++i) {
        emit(i, [&](Index v, const Row& row) { table.rows[next[v]++] = row; });
    }
    for_each_index(vertices, run, [&](std::size_t v) {
        std::sort(table.rows.begin() + table.start[v], table.rows.begin() + table.start[v + 1]);
    });
    return table;
}

void add_faults(Faults& faults, const auto& vertices) {
    faults.fault_vertices.insert(faults.fault_vertices.end(), vertices.begin(), vertices.end());
}

bool names_vertex_twice(const Triangle& t) {
    return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

struct EdgeUse {
    Index other = kNone;       // The larger vertex.
    std::uint32_t corner = 0;  // 3 * triangle + place of the edge's first vertex.

    auto operator<=>(const EdgeUse&) const = default;
};

class SurfaceChecker {
public:
    SurfaceChecker(const Points& vertices, const std::vector<Triangle>& triangles, Faults& faults,
                   const RunContext& run)
        : vertices_(vertices), triangles_(triangles), faults_(faults), run_(run) {}

    void check() {
        check_triangles();
        check_edges_and_vertices();
        check_intersections();
    }

private:
    [[nodiscard]] bool is_degenerate(const Triangle& t) const {
        const Vec3 u = vertices_[t[1]] - vertices_[t[0]];
        const Vec3 v = vertices_[t[2]] - vertices_[t[0]];
        const double longest = std::max({u.squaredNorm(), v.squaredNorm(), (v - u).squaredNorm()});
        // So that a NaN counts as degenerate, too.
        return names_vertex_twice(t) || !(u.cross(v).norm() > kDegenerateHeight * longest);
    }

    void check_triangles() {
        std::vector<std::uint8_t> is_bad(triangles_.size());
        for_each_index(triangles_.size(), run_,
                       [&](std::size_t i) { is_bad[i] = is_degenerate(triangles_[i]); });
        for (std::size_t i = 0; i < triangles_.size(); ++i) {
            if (is_bad[i] != 0) {
                ++faults_.degenerate_triangles;
                add_faults(faults_, triangles_[i]);
            }
        }
    }

    void check_edges_and_vertices() {
        const auto table = tabulate<EdgeUse>(
            vertices_.size(), triangles_.size(), run_, [&](std::size_t i, const auto& add) {
                const Triangle& t = triangles_[i];
                for (std::size_t k = 0; k < 3 && !names_vertex_twice(t); ++k) {
                    const auto [low, high] = std::minmax(t[k], t[(k + 1) % 3]);
                    add(low, EdgeUse{high, static_cast<std::uint32_t>(3 * i + k)});
                }
            });
        fan_of_.resize(3 * triangles_.size());
        std::iota(fan_of_.begin(), fan_of_.end(), 0U);
        for (std::size_t v = 0; v < vertices_.size(); ++v) {
            for (std::size_t i = table.start[v]; i < table.start[v + 1];) {
                std::size_t end = i + 1;
                while (end < table.start[v + 1] && table.rows[end].other == table.rows[i].other) {
                    ++end;
                }
                check_edge(static_cast<Index>(v), &table.rows[i], end - i);
                i = end;
            }
        }
        check_vertices();
    }

    void check_edge(Index low, const EdgeUse* uses, std::size_t count) {
        const bool is_inconsistent = count == 2 && first_vertex(uses[0]) == first_vertex(uses[1]);
        faults_.open_edges += count == 1;
        faults_.non_manifold_edges += count > 2;
        faults_.inconsistent_edges += is_inconsistent;
        if (count != 2 || is_inconsistent) {
            add_faults(faults_, std::array{low, uses[0].other});
        }
        for (std::size_t i = 1; i < count; ++i) {
            for (const Index end : {low, uses[0].other}) {
                join(corner_at(uses[0], end), corner_at(uses[i], end));
            }
        }
    }

    [[nodiscard]] Index first_vertex(const EdgeUse& use) const {
        return triangles_[use.corner / 3][use.corner % 3];
    }

    // Corner of the triangle of an edge at one end of the edge.
    [[nodiscard]] std::uint32_t corner_at(const EdgeUse& use, Index end) const {
        const std::uint32_t triangle = use.corner / 3;
        return first_vertex(use) == end ? use.corner : 3 * triangle + (use.corner + 1) % 3;
    }

    std::uint32_t root(std::uint32_t corner) {
        while (fan_of_[corner] != corner) {
            fan_of_[corner] = fan_of_[fan_of_[corner]];
            corner = fan_of_[corner];
        }
        return corner;
    }

    void join(std::uint32_t a, std::uint32_t b) {
        a = root(a);
        b = root(b);
        fan_of_[std::max(a, b)] = std::min(a, b);
    }

    // Corners are joined across edges: each vertex must have one set of them.
    void check_vertices() {
        std::vector<std::uint8_t> fans(vertices_.size(), 0);
        for (std::uint32_t corner = 0; corner < fan_of_.size(); ++corner) {
            const Triangle& t = triangles_[corner / 3];
            if (fan_of_[corner] != corner || names_vertex_twice(t)) {
                continue;
            }
            auto& count = fans[t[corner % 3]];
            if (count == 1) {
                ++faults_.non_manifold_vertices;
                faults_.fault_vertices.push_back(t[corner % 3]);
            }
            count = static_cast<std::uint8_t>(std::min(count + 1, 2));
        }
    }

    void check_intersections() {
        faults_.intersections =
            self_intersections(vertices_, triangles_, [this] { run_.checkpoint(); });
        for (const auto& [a, b] : faults_.intersections) {
            add_faults(faults_, triangles_[a]);
            add_faults(faults_, triangles_[b]);
        }
    }

    const Points& vertices_;
    const std::vector<Triangle>& triangles_;
    Faults& faults_;
    const RunContext& run_;
    std::vector<std::uint32_t> fan_of_;  // Of each corner, as a union-find forest.
};

struct FaceUse {
    Index middle = kNone;
    Index largest = kNone;
    std::uint32_t id = 0;  // 4 * tet + corner opposite of the face.

    auto operator<=>(const FaceUse&) const = default;
    [[nodiscard]] bool is_same_face(const FaceUse& other) const {
        return middle == other.middle && largest == other.largest;
    }
};

class TetChecker {
public:
    TetChecker(const TetMesh& mesh, Faults& faults, const RunContext& run)
        : mesh_(mesh), faults_(faults), run_(run) {}

    void check_orientation() {
        sign_.resize(mesh_.tets.size());
        for_each_index(mesh_.tets.size(), run_, [&](std::size_t i) {
            sign_[i] = static_cast<std::int8_t>(sign(mesh_.tets[i]));
        });
        for (std::size_t i = 0; i < mesh_.tets.size(); ++i) {
            if (sign_[i] <= 0) {
                ++faults_.inverted_tets;
                add_faults(faults_, mesh_.tets[i]);
            }
        }
    }

    // Counts faces where tets overlap; returns those with one tet, as `boundary_of` does.
    std::vector<Triangle> check_faces() {
        const auto table = tabulate<FaceUse>(
            mesh_.vertices.size(), mesh_.tets.size(), run_, [&](std::size_t t, const auto& add) {
                for (std::size_t corner = 0; corner < 4; ++corner) {
                    auto [a, b, c] = face(static_cast<std::uint32_t>(4 * t + corner));
                    sort_three(a, b, c);
                    add(a, FaceUse{b, c, static_cast<std::uint32_t>(4 * t + corner)});
                }
            });
        const std::size_t n = mesh_.vertices.size();
        std::vector<FoundFaces> blocks((n + kGrain - 1) / kGrain);
        for_each_block(n, kGrain, run_, [&](std::size_t begin, std::size_t end) {
            for (std::size_t v = begin; v < end; ++v) {
                check_faces_of(std::span(table.rows)
                                   .subspan(table.start[v], table.start[v + 1] - table.start[v]),
                               blocks[begin / kGrain]);
            }
        });
        std::vector<std::uint32_t> single;
        for (const FoundFaces& found : blocks) {
            single.insert(single.end(), found.single.begin(), found.single.end());
            for (const std::uint32_t id : found.overlapping) {
                ++faults_.overlapping_tets;
                add_faults(faults_, face(id));
            }
        }
        std::sort(single.begin(), single.end());
        std::vector<Triangle> triangles(single.size());
        std::transform(single.begin(), single.end(), triangles.begin(),
                       [&](std::uint32_t id) { return face(id); });
        return triangles;
    }

private:
    struct FoundFaces {
        std::vector<std::uint32_t> single{};
        std::vector<std::uint32_t> overlapping{};
    };

    // Faces with one smallest vertex.
    void check_faces_of(std::span<const FaceUse> uses, FoundFaces& found) const {
        for (std::size_t i = 0; i < uses.size();) {
            std::size_t end = i + 1;
            while (end < uses.size() && uses[end].is_same_face(uses[i])) {
                ++end;
            }
            if (end - i == 1) {
                found.single.push_back(uses[i].id);
            } else if (end - i > 2 || are_on_one_side(uses[i].id, uses[i + 1].id)) {
                found.overlapping.push_back(uses[i].id);
            }
            i = end;
        }
    }

    [[nodiscard]] int sign(const Tet& tet) const {
        const Vec3& a = mesh_.vertices[tet[0]];
        const Vec3& b = mesh_.vertices[tet[1]];
        const Vec3& c = mesh_.vertices[tet[2]];
        const Vec3& d = mesh_.vertices[tet[3]];
        const Vec3 u = b - a;
        const Vec3 v = c - a;
        const Vec3 w = d - a;
        const double longest = std::sqrt(
            std::max({u.squaredNorm(), v.squaredNorm(), w.squaredNorm(), (v - u).squaredNorm(),
                      (w - v).squaredNorm(), (u - w).squaredNorm()}));
        const double volume6 = u.dot(v.cross(w));
        const bool is_flat = !(std::abs(volume6) > kFlatVolume * longest * longest * longest);
        return is_flat ? 0 : orientation_sign(a, b, c, d);
    }

    // A face that looks outward if its tet is positively oriented.
    [[nodiscard]] Triangle face(std::uint32_t id) const {
        const Tet& tet = mesh_.tets[id / 4];
        const auto& corners = kFaces[id % 4];
        return {tet[corners[0]], tet[corners[1]], tet[corners[2]]};
    }

    static void sort_three(Index& a, Index& b, Index& c) {
        if (a > b) {
            std::swap(a, b);
        }
        if (b > c) {
            std::swap(b, c);
        }
        if (a > b) {
            std::swap(a, b);
        }
    }

    // Two tets lie on different sides of a face if the outward looking faces are opposite.
    [[nodiscard]] bool are_on_one_side(std::uint32_t first, std::uint32_t second) const {
        const Triangle a = face(first);
        const Triangle b = face(second);
        const auto start =
            static_cast<std::size_t>(std::find(b.begin(), b.end(), a[0]) - b.begin());
        const int turn = b[(start + 1) % 3] == a[1] ? 1 : -1;
        return turn * sign_[first / 4] * sign_[second / 4] > 0;
    }

    const TetMesh& mesh_;
    Faults& faults_;
    const RunContext& run_;
    std::vector<std::int8_t> sign_;
};

void sort_fault_vertices(Faults& faults) {
    auto& v = faults.fault_vertices;
    std::sort(v.begin(), v.end());
    v.erase(std::unique(v.begin(), v.end()), v.end());
}

}  // namespace

bool Faults::any() const {
    return open_edges != 0 || non_manifold_edges != 0 || non_manifold_vertices != 0 ||
           inconsistent_edges != 0 || inverted_tets != 0 || degenerate_triangles != 0 ||
           overlapping_tets != 0 || !intersections.empty();
}

std::string Faults::summary() const {
    std::string text;
    const auto add = [&](std::int64_t count, const char* one, const char* many) {
        if (count != 0) {
            text += (text.empty() ? "" : ", ") + std::to_string(count) + " " +
                    (count == 1 ? one : many);
        }
    };
    add(static_cast<std::int64_t>(intersections.size()), "self-intersection", "self-intersections");
    add(open_edges, "open edge", "open edges");
    add(non_manifold_edges, "non-manifold edge", "non-manifold edges");
    add(non_manifold_vertices, "non-manifold vertex", "non-manifold vertices");
    add(inconsistent_edges, "inconsistent edge", "inconsistent edges");
    add(degenerate_triangles, "degenerate triangle", "degenerate triangles");
    add(inverted_tets, "inverted or flat tet", "inverted or flat tets");
    add(overlapping_tets, "face with overlapping tets", "faces with overlapping tets");
    return text.empty() ? "no faults" : text;
}

Faults check_surface(const SurfaceMesh& surface, const RunContext& run) {
    Faults faults;
    SurfaceChecker(surface.vertices, surface.triangles, faults, run).check();
    sort_fault_vertices(faults);
    return faults;
}

Faults check_tets(const TetMesh& mesh, const RunContext& run, std::vector<Triangle>* boundary) {
    Faults faults;
    TetChecker tets(mesh, faults, run);
    tets.check_orientation();
    std::vector<Triangle> triangles = tets.check_faces();
    SurfaceChecker(mesh.vertices, triangles, faults, run).check();
    sort_fault_vertices(faults);
    if (boundary != nullptr) {
        *boundary = std::move(triangles);
    }
    return faults;
}

}  // namespace remesh
