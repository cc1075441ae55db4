#include "core/stages/patches.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>

#include "core/geometry/edge_table.h"
#include "core/mesh/index.h"
#include "core/parallel.h"
#include "core/stages/close_holes.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr std::size_t kVotes = 4;       // Of a triangle: its centroid and a point near each corner.
constexpr int kSweeps = 3;              // Of smoothing the borders.
constexpr double kNearCorner = 2. / 3;  // Weight of the corner in its point.
constexpr std::int32_t kPinhole = 12;   // Fewer triangles that close a hole join what is around it.
constexpr double kOnCurve = 0.25;       // Of its length an edge's middle may lie off its curve.

using Votes = std::array<std::int32_t, kVotes>;

Votes votes_of(const SurfaceMesh& surface, std::size_t t, const Domain& domain) {
    const std::vector<std::int32_t>& patch = domain.boundary().patch;
    const Vec3 middle = centroid(surface, t);
    Index hint = domain.closest(middle).facet;
    Votes votes{patch[at(hint)]};
    for (std::size_t k = 0; k < 3; ++k) {
        const double rest = 0.5 * (1.0 - kNearCorner);
        const Vec3 x = kNearCorner * corner(surface, t, k) +
                       rest * (corner(surface, t, (k + 1) % 3) + corner(surface, t, (k + 2) % 3));
        hint = domain.closest(x, hint).facet;
        votes[k + 1] = patch[at(hint)];
    }
    return votes;
}

// The patch with most votes; the centroid's if it is among them.
std::int32_t elected(const Votes& votes) {
    std::int32_t best = votes[0];
    for (const std::int32_t candidate : votes) {
        if (std::count(votes.begin(), votes.end(), candidate) >
            std::count(votes.begin(), votes.end(), best)) {
            best = candidate;
        }
    }
    return best;
}

using Neighbours = std::vector<std::array<Index, 3>>;

// Triangles across the edges of each; kNone where there isn't just one.
Neighbours neighbours_of(const SurfaceMesh& surface) {
    Neighbours neighbours(surface.triangles.size(), {kNone, kNone, kNone});
    const EdgeTable table(surface.triangles, surface.vertices.size());
    for (const EdgeTable::Edge& edge : table.edges()) {
        if (edge.count == 2) {
            const auto halves = table.half_edges(edge);
            for (const std::size_t side : {0U, 1U}) {
                const auto half = halves[side];
                neighbours[EdgeTable::triangle_of(half)][EdgeTable::corner_of(half)] =
                    static_cast<Index>(EdgeTable::triangle_of(halves[1 - side]));
            }
        }
    }
    return neighbours;
}

// Each sweep looks at the patches before it, so that the order of triangles doesn't matter.
void smooth_borders(const std::vector<Votes>& votes, const Neighbours& neighbours,
                    std::vector<std::int32_t>& patch) {
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
        const std::vector<std::int32_t> before = patch;
        for (std::size_t t = 0; t < patch.size(); ++t) {
            for (const std::int32_t candidate : votes[t]) {
                const auto around = std::count_if(
                    neighbours[t].begin(), neighbours[t].end(),
                    [&](Index n) { return n != kNone && before[at(n)] == candidate; });
                if (around >= 2) {
                    patch[t] = candidate;
                }
            }
        }
    }
}

// The patch that most neighbours have that aren't in pinholes themselves; kNone if all are.
std::int32_t patch_around(const std::array<Index, 3>& neighbours, const std::vector<char>& is_hole,
                          const std::vector<std::int32_t>& patch) {
    std::array<std::int32_t, 3> around{kNone, kNone, kNone};
    std::transform(neighbours.begin(), neighbours.end(), around.begin(), [&](Index n) {
        return n != kNone && is_hole[at(n)] == 0 ? patch[at(n)] : kNone;
    });
    std::sort(around.begin(), around.end());
    return around[0] != kNone && around[0] == around[1] ? around[0] : around[2];
}

// What closes a pinhole is no part of its own: it takes the patches around it, from its rim inward.
void absorb_pinholes(std::int32_t closed, const Neighbours& neighbours,
                     std::vector<std::int32_t>& patch) {
    DisjointSets sets(patch.size());
    for (std::size_t t = 0; t < patch.size(); ++t) {
        for (const Index n : neighbours[t]) {
            if (n != kNone && patch[t] == closed && patch[at(n)] == closed) {
                sets.merge(static_cast<Index>(t), n);
            }
        }
    }
    std::vector<std::int32_t> size(patch.size(), 0);
    for (std::size_t t = 0; t < patch.size(); ++t) {
        size[at(sets.find(static_cast<Index>(t)))] += patch[t] == closed ? 1 : 0;
    }
    std::vector<char> is_hole(patch.size(), 0);
    for (std::size_t t = 0; t < patch.size(); ++t) {
        is_hole[t] = patch[t] == closed && size[at(sets.find(static_cast<Index>(t)))] < kPinhole;
    }
    for (std::int32_t sweep = 0; sweep < kPinhole; ++sweep) {
        const std::vector<char> before = is_hole;
        for (std::size_t t = 0; t < patch.size(); ++t) {
            const std::int32_t found =
                before[t] != 0 ? patch_around(neighbours[t], before, patch) : kNone;
            if (found != kNone) {
                patch[t] = found;
                is_hole[t] = 0;
            }
        }
    }
}

void warn_of_lost(const SurfaceMesh& boundary, const SurfaceMesh& surface, RunContext& run) {
    const auto count = at(*std::max_element(boundary.patch.begin(), boundary.patch.end()) + 1);
    std::vector<Index> seen(count, kNone);  // A triangle of each in the input.
    for (std::size_t t = 0; t < boundary.patch.size(); ++t) {
        seen[at(boundary.patch[t])] = static_cast<Index>(t);
    }
    for (const std::int32_t id : surface.patch) {
        seen[at(id)] = kNone;
    }
    for (std::size_t id = 0; id < count; ++id) {
        const std::string name =
            id < boundary.patch_names.size() ? boundary.patch_names[id] : std::to_string(id);
        if (seen[id] != kNone && name != kClosedHoles) {
            run.warn({.code = "PATCH_LOST",
                      .message = "no triangle of the result belongs to the patch \"" + name +
                                 "\": it is smaller than the edge length",
                      .at = centroid(boundary, at(seen[id]))});
        }
    }
}

/// Which edges of a surface run along feature curves.
class CurveEdges {
public:
    CurveEdges(const FeatureSet& features, const ImproveResult& improved)
        : features_(features), improved_(improved) {}

    [[nodiscard]] bool contain(const EdgeTable::Edge& edge) const {
        if (!is_on_curve(edge.low) || !is_on_curve(edge.high)) {
            return false;
        }
        const Index a = improved_.curve[at(edge.low)];
        const Index b = improved_.curve[at(edge.high)];
        if (a != kNone && b != kNone) {
            return a == b && is_along(edge, a);
        }
        if (a != kNone || b != kNone) {
            return is_along(edge, std::max(a, b));
        }
        for (std::size_t c = 0; c < features_.curves.size(); ++c) {
            if (is_along(edge, static_cast<Index>(c))) {
                return true;  // A curve so short that it has corners only.
            }
        }
        return false;
    }

private:
    [[nodiscard]] bool is_on_curve(Index v) const {
        return improved_.kind[at(v)] >= ParticleKind::Curve;
    }

    // Not a chord from one stretch of the curve to another.
    [[nodiscard]] bool is_along(const EdgeTable::Edge& edge, Index curve) const {
        const Vec3& a = improved_.mesh.vertices[at(edge.low)];
        const Vec3& b = improved_.mesh.vertices[at(edge.high)];
        const Vec3 middle = 0.5 * (a + b);
        const Vec3 foot = closest_on_curve(features_.curves[at(curve)], middle).point;
        return (foot - middle).norm() < kOnCurve * (a - b).norm();
    }

    const FeatureSet& features_;
    const ImproveResult& improved_;
};

}  // namespace

void carry_patches(const Domain& domain, SurfaceMesh& surface, RunContext& run) {
    const SurfaceMesh& boundary = domain.boundary();
    if (boundary.patch.empty()) {
        return;
    }
    std::vector<Votes> votes(surface.triangles.size());
    surface.patch.resize(votes.size());
    for_each_index(votes.size(), run, [&](std::size_t t) {
        votes[t] = votes_of(surface, t, domain);
        surface.patch[t] = elected(votes[t]);
    });
    const Neighbours neighbours = neighbours_of(surface);
    smooth_borders(votes, neighbours, surface.patch);
    surface.patch_names = boundary.patch_names;
    if (!surface.patch_names.empty() && surface.patch_names.back() == kClosedHoles) {
        absorb_pinholes(static_cast<std::int32_t>(surface.patch_names.size()) - 1, neighbours,
                        surface.patch);
    }
    warn_of_lost(boundary, surface, run);
}

std::vector<std::int32_t> number_faces(const FeatureSet& features, const ImproveResult& improved) {
    const TetMesh& mesh = improved.mesh;
    const std::vector<Triangle> triangles = boundary_of(mesh.tets);
    const CurveEdges curves(features, improved);
    DisjointSets sets(triangles.size());
    const EdgeTable table(triangles, mesh.vertices.size());
    for (const EdgeTable::Edge& edge : table.edges()) {
        if (edge.count == 2 && !curves.contain(edge)) {
            const auto halves = table.half_edges(edge);
            sets.merge(static_cast<Index>(EdgeTable::triangle_of(halves[0])),
                       static_cast<Index>(EdgeTable::triangle_of(halves[1])));
        }
    }

    std::vector<double> area(triangles.size(), 0.0);  // Of the set that triangle t names.
    std::vector<Index> faces;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const Index set = sets.find(static_cast<Index>(t));
        if (at(set) == t) {
            faces.push_back(set);
        }
        const Vec3& a = mesh.vertices[at(triangles[t][0])];
        const Vec3& b = mesh.vertices[at(triangles[t][1])];
        const Vec3& c = mesh.vertices[at(triangles[t][2])];
        area[at(set)] += (b - a).cross(c - a).norm();
    }
    std::stable_sort(faces.begin(), faces.end(),
                     [&](Index a, Index b) { return area[at(a)] > area[at(b)]; });

    std::vector<std::int32_t> number(triangles.size(), 0);
    for (std::size_t i = 0; i < faces.size(); ++i) {
        number[at(faces[i])] = static_cast<std::int32_t>(i);
    }
    std::vector<std::int32_t> patch(triangles.size());
    for (std::size_t t = 0; t < patch.size(); ++t) {
        patch[t] = number[at(sets.find(static_cast<Index>(t)))];
    }
    return patch;
}

}  // namespace remesh
