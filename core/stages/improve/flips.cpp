#include "core/stages/improve/flips.h"

#include <algorithm>
#include <array>
#include <optional>

#include "core/parallel.h"
#include "core/stages/improve/measures.h"
#include "core/stages/improve/ring.h"

namespace remesh::improve {
namespace {

constexpr double kGain = 1e-4;            // Least relative gain, so that no two flips take turns.
constexpr double kNormalCosine = 0.8;     // About 37 degrees.
constexpr double kBentCosine = 0.75;      // Between the two new triangles of a surface flip.
constexpr double kBadAngleSine = 0.342;   // 20 degrees: such triangles have no normal to trust.
constexpr double kPoorAngleSine = 0.5;    // 30 degrees.
constexpr double kFineAngleSine = 0.574;  // 35 degrees: may get worse down to this.
constexpr double kPeelLimit = 0.35;       // Boundary tets of lower quality may be peeled off.

template <typename Measure>
double measure(const LiveMesh& mesh, Index a, Index b, Index c, Index d) {
    return Measure::of(mesh.point(a), mesh.point(b), mesh.point(c), mesh.point(d));
}

template <typename Measure>
double measure(const LiveMesh& mesh, const Tet& t) {
    return measure<Measure>(mesh, t[0], t[1], t[2], t[3]);
}

// A planned surface flip: how much the smallest angle of the two triangles gains.
struct SurfaceFlip {
    double old_sine = 0.0;
    double new_sine = 0.0;
};

// The boundary edge (a, b) becomes (u, w), the ends of its open ring.
std::optional<SurfaceFlip> plan_surface_flip(const LiveMesh& mesh, Index a, Index b,
                                             const Ring& ring) {
    const Index u = ring.vertices[0];
    const Index w = ring.vertices[ring.size - 1];
    const bool is_plain =
        mesh.kind(a) == ParticleKind::Surface || mesh.kind(b) == ParticleKind::Surface;
    const bool is_ours = mesh.on_boundary(a) && mesh.on_boundary(b) && !mesh.is_locked(a) &&
                         !mesh.is_locked(b) && !mesh.is_locked(u) && !mesh.is_locked(w);
    if (!is_plain || !is_ours) {
        return std::nullopt;
    }
    for (const Index t : mesh.around(u)) {
        const auto* const end = ring.tets.begin() + ring.tet_count;
        if (ring.tet_count > 1 && has(mesh.tet(t), w) &&
            std::find(ring.tets.begin(), end, t) == end) {
            return std::nullopt;  // The new edge is there already, elsewhere.
        }
    }
    const Vec3& pa = mesh.point(a);
    const Vec3& pb = mesh.point(b);
    const Vec3& pu = mesh.point(u);
    const Vec3& pw = mesh.point(w);
    const Vec3 old1 = (pb - pa).cross(pu - pa);
    const Vec3 old2 = (pw - pa).cross(pb - pa);
    const Vec3 mean = (old1 + old2).normalized();
    const Vec3 new1 = (pw - pa).cross(pu - pa).normalized();
    const Vec3 new2 = (pu - pb).cross(pw - pb).normalized();
    SurfaceFlip flip;
    flip.old_sine = std::min(angle_sine(pa, pb, pu), angle_sine(pa, pb, pw));
    flip.new_sine = std::min(angle_sine(pa, pw, pu), angle_sine(pb, pw, pu));
    const bool is_bent = new1.dot(mean) < kNormalCosine || new2.dot(mean) < kNormalCosine ||
                         new1.dot(new2) < kBentCosine;
    const bool was_bent =
        flip.old_sine >= kBadAngleSine && old1.normalized().dot(old2.normalized()) < kNormalCosine;
    if (is_bent || was_bent) {
        return std::nullopt;
    }
    return flip;
}

// What tets have to beat for a surface flip, where its triangles allow it at all.
template <typename Measure>
std::optional<double> limit_of(const SurfaceFlip& flip, double worst_tet, bool is_peel);

template <>
std::optional<double> limit_of<RadiusRatio>(const SurfaceFlip& flip, double worst_tet,
                                            bool is_peel) {
    if (flip.new_sine < std::min(flip.old_sine + 1e-9, kFineAngleSine)) {
        return std::nullopt;
    }
    const double gain = angle_degrees(flip.new_sine) - angle_degrees(flip.old_sine);
    if (is_peel && worst_tet > (gain > 5.0 ? 0.6 : kPeelLimit)) {
        return std::nullopt;
    }
    // A much better triangle may cost some of the tets.
    return gain > 3.0 && flip.old_sine < 0.5 ? std::min(worst_tet, kPeelLimit) : worst_tet;
}

template <>
std::optional<double> limit_of<DihedralSine>(const SurfaceFlip& flip, double worst_tet,
                                             bool /*is_peel*/) {
    const double worst = std::min(worst_tet, kTriangleScale * flip.old_sine);
    // A bad tet isn't worth a bad triangle: that one would be seen.
    if (kTriangleScale * flip.new_sine <= worst * (1.0 + kGain) ||
        flip.new_sine < std::min(flip.old_sine, kPoorAngleSine)) {
        return std::nullopt;
    }
    return worst;
}

bool is_manifold_at(const LiveMesh& mesh, Index a, Index b, Index u, Index w) {
    return mesh.is_one_fan(a) && mesh.is_one_fan(b) && mesh.is_one_fan(u) && mesh.is_one_fan(w);
}

// The only tet at a boundary edge, with both triangles there, is taken off.
bool peel(LiveMesh& mesh, Index a, Index b, const Ring& ring) {
    if (mesh.around(a).size() < 3 || mesh.around(b).size() < 3) {
        return false;
    }
    const Tet tet = mesh.tet(ring.tets[0]);
    mesh.remove(ring.tets[0]);
    if (!is_manifold_at(mesh, a, b, ring.vertices[0], ring.vertices[1])) {
        mesh.restore(ring.tets[0], tet);  // In its place: callers go on with it.
        return false;
    }
    return true;
}

// Best triangulation of the ring's polygon: [i][j] is the worst tet over the part from i to j.
struct Plan {
    std::array<std::array<double, kMaxRing>, kMaxRing> worst;
    std::array<std::array<std::uint8_t, kMaxRing>, kMaxRing> middle;
};

template <typename Measure>
double plan_ring(const LiveMesh& mesh, Index a, Index b, const Ring& ring, double limit,
                 Plan& plan) {
    const auto& r = ring.vertices;
    const std::size_t m = ring.size;
    for (std::size_t i = m; i-- > 0;) {
        for (std::size_t j = i + 1; j < m; ++j) {
            if (j == i + 1) {
                plan.worst[i][j] = 1.0;
                continue;
            }
            double best = -1.0;
            for (std::size_t k = i + 1; k < j; ++k) {
                double value = std::min(plan.worst[i][k], plan.worst[k][j]);
                if (value <= std::max(limit, best)) {
                    continue;
                }
                value = std::min(value, measure<Measure>(mesh, r[i], r[k], r[j], b));
                if (value <= std::max(limit, best)) {
                    continue;
                }
                value = std::min(value, measure<Measure>(mesh, r[i], r[j], r[k], a));
                if (value > std::max(limit, best)) {
                    best = value;
                    plan.middle[i][j] = static_cast<std::uint8_t>(k);
                }
            }
            plan.worst[i][j] = best;
        }
    }
    return plan.worst[0][m - 1];
}

void fill_ring(LiveMesh& mesh, Index a, Index b, const Ring& ring, const Plan& plan, std::size_t i,
               std::size_t j) {
    if (j == i + 1) {
        return;
    }
    const auto& r = ring.vertices;
    const std::size_t k = plan.middle[i][j];
    mesh.add({r[i], r[k], r[j], b});
    mesh.add({r[i], r[j], r[k], a});
    fill_ring(mesh, a, b, ring, plan, i, k);
    fill_ring(mesh, a, b, ring, plan, k, j);
}

// How an edge is to be removed.
struct EdgeRemoval {
    Ring ring{};
    Plan plan;             // Of the ring, unless its only tet is peeled off.
    bool is_peel = false;  // The boundary may turn out not to allow it.
};

template <typename Measure>
bool plan_edge(const LiveMesh& mesh, Index a, Index b, EdgeRemoval& removal) {
    const auto ring = ring_around(mesh, a, b);
    if (!ring) {
        return false;
    }
    removal.ring = *ring;
    removal.is_peel = false;
    double old = 1.0;
    for (std::size_t i = 0; i < ring->tet_count; ++i) {
        old = std::min(old, measure<Measure>(mesh, mesh.tet(ring->tets[i])));
    }
    if (ring->is_open()) {
        const auto flip = plan_surface_flip(mesh, a, b, *ring);
        if (!flip) {
            return false;
        }
        const auto worst = limit_of<Measure>(*flip, old, ring->tet_count == 1);
        if (!worst) {
            return false;
        }
        removal.is_peel = ring->tet_count == 1;
        old = *worst;
    } else if (ring->size < 3) {
        return false;
    }
    const double limit = std::max(old, 0.0) * (1.0 + kGain) + 1e-9;
    return removal.is_peel || plan_ring<Measure>(mesh, a, b, *ring, limit, removal.plan) > limit;
}

template <typename Measure>
bool remove_edge_by(LiveMesh& mesh, Index a, Index b) {
    EdgeRemoval removal;
    if (!plan_edge<Measure>(mesh, a, b, removal)) {
        return false;
    }
    const Ring& ring = removal.ring;
    if (removal.is_peel) {
        return peel(mesh, a, b, ring);
    }
    for (std::size_t i = 0; i < ring.tet_count; ++i) {
        mesh.remove(ring.tets[i]);
    }
    fill_ring(mesh, a, b, ring, removal.plan, 0, ring.size - 1);
    return true;
}

// A face between two tets, clockwise seen from d, and the corners on both sides.
struct FaceRemoval {
    Index other = kNone;
    std::array<Index, 3> face{};
    Index d = kNone;
    Index e = kNone;
};

template <typename Measure>
bool plan_face(const LiveMesh& mesh, Index t, std::size_t corner, FaceRemoval& removal) {
    const Tet& tet = mesh.tet(t);
    const auto& face = kFaces[corner];
    const Index d = tet[corner];
    const Index f0 = tet[face[1]];
    const Index f1 = tet[face[0]];
    const Index f2 = tet[face[2]];
    Index other = kNone;
    for (const Index s : mesh.around(f0)) {
        if (s != t && has(mesh.tet(s), f1) && has(mesh.tet(s), f2)) {
            other = s;
            break;
        }
    }
    if (other == kNone) {
        return false;
    }
    Index e = kNone;
    for (const Index v : mesh.tet(other)) {
        if (v != f0 && v != f1 && v != f2) {
            e = v;
        }
    }
    const double old =
        std::min(measure<Measure>(mesh, tet), measure<Measure>(mesh, mesh.tet(other)));
    const double limit = std::max(old, 0.0) * (1.0 + kGain) + 1e-9;
    if (measure<Measure>(mesh, f0, f1, e, d) <= limit ||
        measure<Measure>(mesh, f1, f2, e, d) <= limit ||
        measure<Measure>(mesh, f2, f0, e, d) <= limit) {
        return false;
    }
    removal = {other, {f0, f1, f2}, d, e};
    const auto at_d = mesh.around(d);
    return std::none_of(at_d.begin(), at_d.end(), [&](Index s) { return has(mesh.tet(s), e); });
}

template <typename Measure>
bool remove_face_by(LiveMesh& mesh, Index t, std::size_t corner) {
    FaceRemoval removal;
    if (!plan_face<Measure>(mesh, t, corner, removal)) {
        return false;
    }
    const auto& [f0, f1, f2] = removal.face;
    mesh.remove(t);
    mesh.remove(removal.other);
    mesh.add({f0, f1, removal.e, removal.d});
    mesh.add({f1, f2, removal.e, removal.d});
    mesh.add({f2, f0, removal.e, removal.d});
    return true;
}

// The flips of a tet: removals of its 6 edges, then of its 4 faces.
constexpr std::size_t kFlips = 10;

// The first flip of a tet that can be planned, or kFlips.
template <typename Measure>
std::size_t first_flip(const LiveMesh& mesh, Index t) {
    const Tet& tet = mesh.tet(t);
    EdgeRemoval edge_removal;
    FaceRemoval face_removal;
    for (std::size_t k = 0; k < kFlips; ++k) {
        const bool is_planned =
            k < kEdges.size()
                ? plan_edge<Measure>(mesh, tet[kEdges[k][0]], tet[kEdges[k][1]], edge_removal)
                : plan_face<Measure>(mesh, t, k - kEdges.size(), face_removal);
        if (is_planned) {
            return k;
        }
    }
    return kFlips;
}

// Tries the flips of a tet from the given one on.
template <typename Measure>
bool flip_tet_by(LiveMesh& mesh, Index t, std::size_t first = 0) {
    const Tet tet = mesh.tet(t);
    for (std::size_t k = first; k < kFlips; ++k) {
        const bool is_done =
            k < kEdges.size() ? remove_edge_by<Measure>(mesh, tet[kEdges[k][0]], tet[kEdges[k][1]])
                              : remove_face_by<Measure>(mesh, t, k - kEdges.size());
        if (is_done) {
            return true;
        }
    }
    return false;
}

}  // namespace

bool remove_edge(LiveMesh& mesh, Index a, Index b, Judge judge) {
    return judge == Judge::RadiusRatio ? remove_edge_by<RadiusRatio>(mesh, a, b)
                                       : remove_edge_by<DihedralSine>(mesh, a, b);
}

bool remove_face(LiveMesh& mesh, Index t, std::size_t corner, Judge judge) {
    return judge == Judge::RadiusRatio ? remove_face_by<RadiusRatio>(mesh, t, corner)
                                       : remove_face_by<DihedralSine>(mesh, t, corner);
}

bool flip_tet(LiveMesh& mesh, Index t, Judge judge) {
    return judge == Judge::RadiusRatio ? flip_tet_by<RadiusRatio>(mesh, t)
                                       : flip_tet_by<DihedralSine>(mesh, t);
}

std::int64_t flip_pass(LiveMesh& mesh, double limit, bool all, const RunContext& run) {
    constexpr std::size_t kBlock = 4096;
    constexpr std::uint8_t kUnknown = 0xFF;
    constexpr std::uint8_t kFine = 0xFE;  // Else the first flip that could be planned.
    const auto has_changed = [&](const Tet& tet, LiveMesh::Use use) {
        return std::any_of(tet.begin(), tet.end(),
                           [&](Index v) { return mesh.has_changed(v, use); });
    };
    const auto is_due = [&](const Tet& tet) {
        return all || has_changed(tet, LiveMesh::Use::Smoothing);
    };
    const auto is_poor = [&](const Tet& tet) { return measure<RadiusRatio>(mesh, tet) < limit; };
    for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
        mesh.set_changed(index(v), false, LiveMesh::Use::Flips);
    }
    // Most can't be flipped. Flips move no vertex, so that what is planned before the first holds
    // for tets whose vertices keep their tets.
    std::vector<std::uint8_t> planned(mesh.slot_count(), kUnknown);
    for_each_index(planned.size(), run, [&](std::size_t i) {
        const Index t = index(i);
        if (mesh.is_alive(t) && is_due(mesh.tet(t))) {
            planned[i] = is_poor(mesh.tet(t))
                             ? static_cast<std::uint8_t>(first_flip<RadiusRatio>(mesh, t))
                             : kFine;
        }
    });

    std::int64_t flips = 0;
    // Goes on to the tets that flips append; the bound only makes it plain that the loop ends.
    const std::size_t bound = 2 * mesh.slot_count() + 1000;
    for (std::size_t i = 0; i < std::min(mesh.slot_count(), bound); ++i) {
        if (i % kBlock == 0) {
            run.checkpoint();
        }
        const Index t = index(i);
        const auto known = i < planned.size() ? planned[i] : kUnknown;
        if (!mesh.is_alive(t) || known == kFine ||
            (known == kUnknown && !(is_due(mesh.tet(t)) && is_poor(mesh.tet(t))))) {
            continue;
        }
        const bool is_stale = known == kUnknown || has_changed(mesh.tet(t), LiveMesh::Use::Flips);
        flips += flip_tet_by<RadiusRatio>(mesh, t, is_stale ? 0 : known) ? 1 : 0;
    }
    return flips;
}

}  // namespace remesh::improve
