#include "core/stages/clean.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "core/error.h"
#include "core/geometry/edge_table.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

// A vertex farther out than this many times the typical distance from the middle is garbage: one
// such vertex would take all resolution from the rest.
constexpr double kFarOut = 1e4;
// Twice the area over the longest edge squared. Below, a triangle has no direction to speak of.
constexpr double kFlat = 1e-14;

std::uint64_t mix(std::uint64_t x) {  // splitmix64
    x += 0x9e3779b97f4a7c15U;
    x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
    x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
    return x ^ (x >> 31U);
}

/// Finds equal items among those numbered from 0: open addressing, first come first kept.
template <typename HashOf, typename AreEqual>
class FirstOfKind {
public:
    FirstOfKind(std::size_t capacity, HashOf hash_of, AreEqual are_equal)
        : slots_(std::bit_ceil(2 * capacity + 1), kNone),
          hash_of_(hash_of),
          are_equal_(are_equal) {}

    /// The first item that equals `item`, which may be itself.
    Index add(Index item) {
        const std::size_t mask = slots_.size() - 1;
        for (std::size_t at = hash_of_(item) & mask;; at = (at + 1) & mask) {
            if (slots_[at] == kNone) {
                slots_[at] = item;
                return item;
            }
            if (are_equal_(slots_[at], item)) {
                return slots_[at];
            }
        }
    }

private:
    std::vector<Index> slots_;
    HashOf hash_of_;
    AreEqual are_equal_;
};

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

class Cleaner {
public:
    Cleaner(const SurfaceMesh& input, RunContext& run) : input_(input), run_(run) {}

    CleanResult clean(double h) {
        if (input_.triangles.empty()) {
            throw Error(ErrorCode::InvalidInput, "the surface has no triangles");
        }
        weld();
        run_.checkpoint();
        drop_bad_triangles();
        drop_duplicates();
        if (result_.surface.triangles.empty()) {
            throw Error(ErrorCode::InvalidInput,
                        "none of the surface's " + std::to_string(input_.triangles.size()) +
                            " triangles has an area and finite coordinates");
        }
        compact_vertices();
        run_.checkpoint();
        measure(h);
        return std::move(result_);
    }

private:
    void weld() {
        const Points& vertices = input_.vertices;
        const Box box = plausible_box(vertices);
        const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x + 0.0); };
        FirstOfKind kinds(
            vertices.size(),
            [&](Index i) {
                const Vec3& v = vertices[static_cast<std::size_t>(i)];
                return mix(bits(v[0]) ^ mix(bits(v[1]) ^ mix(bits(v[2]))));
            },
            [&](Index a, Index b) {
                return vertices[static_cast<std::size_t>(a)] ==
                       vertices[static_cast<std::size_t>(b)];
            });
        first_.resize(vertices.size());
        for (std::size_t i = 0; i < vertices.size(); ++i) {
            const Vec3& v = vertices[i];
            first_[i] = contains(box, v) ? kinds.add(static_cast<Index>(i)) : kNone;
        }
    }

    void keep(const Triangle& triangle, std::size_t from) {
        result_.surface.triangles.push_back(triangle);
        if (!input_.patch.empty()) {
            result_.surface.patch.push_back(input_.patch[from]);
        }
    }

    void drop_bad_triangles() {
        std::int64_t not_finite = 0;
        std::int64_t flat = 0;
        std::optional<Vec3> first_flat;
        result_.surface.triangles.reserve(input_.triangles.size());
        for (std::size_t i = 0; i < input_.triangles.size(); ++i) {
            Triangle t;
            for (std::size_t k = 0; k < 3; ++k) {
                t[k] = first_[static_cast<std::size_t>(input_.triangles[i][k])];
            }
            if (t[0] == kNone || t[1] == kNone || t[2] == kNone) {
                ++not_finite;
            } else if (is_flat(t)) {
                ++flat;
                if (!first_flat) {
                    first_flat = input_.vertices[static_cast<std::size_t>(t[0])];
                }
            } else {
                keep(t, i);
            }
        }
        auto& facts = result_.facts;
        facts.triangles = static_cast<std::int64_t>(input_.triangles.size());
        facts.degenerate_triangles = not_finite + flat;
        if (not_finite > 0) {
            result_.defects.push_back(
                {.code = "NON_FINITE",
                 .description = count_of(not_finite, "triangle") +
                                " with coordinates that aren't finite, or absurdly far from all "
                                "others, left out",
                 .count = not_finite});
        }
        if (flat > 0) {
            result_.defects.push_back(
                {.code = "DEGENERATE_TRIANGLES",
                 .description = count_of(flat, "triangle") + " without area left out",
                 .count = flat,
                 .at = first_flat});
        }
    }

    [[nodiscard]] bool is_flat(const Triangle& t) const {
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) {
            return true;
        }
        const Vec3& a = input_.vertices[static_cast<std::size_t>(t[0])];
        const Vec3 u = input_.vertices[static_cast<std::size_t>(t[1])] - a;
        const Vec3 v = input_.vertices[static_cast<std::size_t>(t[2])] - a;
        const double longest2 = std::max({u.squaredNorm(), v.squaredNorm(), (u - v).squaredNorm()});
        return !(u.cross(v).norm() > kFlat * longest2);
    }

    void drop_duplicates() {
        auto& surface = result_.surface;
        std::vector<Triangle> sorted = surface.triangles;
        for (auto& t : sorted) {
            std::sort(t.begin(), t.end());
        }
        FirstOfKind kinds(
            sorted.size(),
            [&](Index i) {
                const auto& t = sorted[static_cast<std::size_t>(i)];
                const auto word = [&](std::size_t k) { return static_cast<std::uint64_t>(t[k]); };
                return mix(word(0) ^ mix((word(1) << 32U) | word(2)));
            },
            [&](Index a, Index b) {
                return sorted[static_cast<std::size_t>(a)] == sorted[static_cast<std::size_t>(b)];
            });
        std::size_t kept = 0;
        std::optional<Vec3> first_twin;
        for (std::size_t i = 0; i < sorted.size(); ++i) {
            if (kinds.add(static_cast<Index>(i)) == static_cast<Index>(i)) {
                surface.triangles[kept] = surface.triangles[i];
                if (!surface.patch.empty()) {
                    surface.patch[kept] = surface.patch[i];
                }
                ++kept;
            } else if (!first_twin) {
                first_twin = input_.vertices[static_cast<std::size_t>(sorted[i][0])];
            }
        }
        const auto dropped = static_cast<std::int64_t>(sorted.size() - kept);
        surface.triangles.resize(kept);
        surface.patch.resize(surface.patch.empty() ? 0 : kept);
        result_.facts.duplicate_triangles = dropped;
        if (dropped > 0) {
            result_.defects.push_back(
                {.code = "DUPLICATE_TRIANGLES",
                 .description = count_of(dropped, "triangle") + " that repeat another left out",
                 .count = dropped,
                 .at = first_twin});
        }
    }

    void compact_vertices() {
        auto& surface = result_.surface;
        surface.patch_names = input_.patch_names;
        std::vector<Index> renamed(input_.vertices.size(), kNone);
        for (auto& t : surface.triangles) {
            for (auto& v : t) {
                renamed[static_cast<std::size_t>(v)] = 0;
            }
        }
        for (std::size_t i = 0; i < renamed.size(); ++i) {
            if (renamed[i] != kNone) {
                renamed[i] = static_cast<Index>(surface.vertices.size());
                surface.vertices.push_back(input_.vertices[i]);
            }
        }
        for (auto& t : surface.triangles) {
            for (auto& v : t) {
                v = renamed[static_cast<std::size_t>(v)];
            }
        }
    }

    void measure(double h) {
        const auto& surface = result_.surface;
        auto& facts = result_.facts;
        const EdgeTable table(surface.triangles, surface.vertices.size());
        DisjointSets parts(surface.triangles.size());
        DisjointSets rims(surface.vertices.size());
        std::vector<char> on_rim(surface.vertices.size(), 0);
        double length_sum = 0.0;
        double square_sum = 0.0;
        double uses = 0.0;
        double sharp_length = 0.0;
        for (const auto& edge : table.edges()) {
            const double length = (surface.vertices[static_cast<std::size_t>(edge.low)] -
                                   surface.vertices[static_cast<std::size_t>(edge.high)])
                                      .norm();
            length_sum += length * edge.count;
            square_sum += length * length * edge.count;
            uses += edge.count;
            const auto halves = table.half_edges(edge);
            for (const auto half : halves) {
                parts.merge(static_cast<Index>(EdgeTable::triangle_of(halves[0])),
                            static_cast<Index>(EdgeTable::triangle_of(half)));
            }
            if (edge.count == 1) {
                ++facts.boundary_edges;
                on_rim[static_cast<std::size_t>(edge.low)] = 1;
                on_rim[static_cast<std::size_t>(edge.high)] = 1;
                rims.merge(edge.low, edge.high);
            } else if (edge.count > 2) {
                if (facts.non_manifold_edges++ == 0) {
                    result_.first_non_manifold =
                        surface.vertices[static_cast<std::size_t>(edge.low)];
                }
            } else {
                const bool same = start_of(surface.triangles, halves[0]) ==
                                  start_of(surface.triangles, halves[1]);
                facts.inconsistent_edges += same;
                sharp_length += is_bent(table, edge, same) ? length : 0.0;
            }
        }
        for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
            facts.components += parts.find(static_cast<Index>(i)) == static_cast<Index>(i);
            facts.area += area_vector(surface, i).norm();
        }
        for (std::size_t i = 0; i < on_rim.size(); ++i) {
            facts.boundary_loops +=
                on_rim[i] && rims.find(static_cast<Index>(i)) == static_cast<Index>(i);
        }
        facts.vertices = static_cast<std::int64_t>(surface.vertices.size());
        facts.mean_edge = length_sum / uses;
        facts.edge_variation =
            std::sqrt(std::max(0.0, square_sum / uses - facts.mean_edge * facts.mean_edge)) /
            facts.mean_edge;
        facts.sharp_edge_density = sharp_length * h / facts.area;
        facts.bounds = bounding_box(surface.vertices);
    }

    [[nodiscard]] bool is_bent(const EdgeTable& table, const EdgeTable::Edge& edge,
                               bool inconsistent) const {
        constexpr double kSharpCosine = 0.5 * std::numbers::sqrt3;  // 30 degrees.
        const auto halves = table.half_edges(edge);
        const Vec3 a = area_vector(result_.surface, EdgeTable::triangle_of(halves[0]));
        const Vec3 b = area_vector(result_.surface, EdgeTable::triangle_of(halves[1]));
        const double cosine = a.dot(b) / (a.norm() * b.norm());
        return (inconsistent ? -cosine : cosine) < kSharpCosine;
    }

    const SurfaceMesh& input_;
    RunContext& run_;
    std::vector<Index> first_;  // Of each input vertex: the first one at its position, or kNone.
    CleanResult result_;
};

}  // namespace

Box plausible_box(const Points& vertices) {
    Box box{Vec3::Constant(-std::numeric_limits<double>::max()),
            Vec3::Constant(std::numeric_limits<double>::max())};
    std::vector<double> values;
    Vec3 middle;
    Vec3 spread;
    for (Eigen::Index d = 0; d < 3; ++d) {
        values.clear();
        for (const auto& v : vertices) {
            if (v.allFinite()) {
                values.push_back(v[d]);
            }
        }
        if (values.empty()) {
            return box;
        }
        middle[d] = median(values);
        for (auto& value : values) {
            value = std::abs(value - middle[d]);
        }
        spread[d] = median(values);
    }
    const double reach = kFarOut * spread.maxCoeff();
    if (reach > 0.0 && std::isfinite(reach)) {
        box = {middle - Vec3::Constant(reach), middle + Vec3::Constant(reach)};
    }
    return box;
}

CleanResult clean_surface(const SurfaceMesh& input, double h, RunContext& run) {
    return Cleaner(input, run).clean(h);
}

}  // namespace remesh
