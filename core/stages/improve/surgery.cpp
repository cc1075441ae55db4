#include "core/stages/improve/surgery.h"

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "core/stages/improve/measures.h"
#include "core/stages/improve/ring.h"

namespace remesh::improve {
namespace {

constexpr double kLeastSine = 0.02;  // Of the dihedrals of a tet that is laid on.

bool is_bound(ParticleKind kind) {
    return kind == ParticleKind::Curve || kind == ParticleKind::Corner;
}

bool is_free(const LiveMesh& mesh, Index v) {
    return mesh.kind(v) == ParticleKind::Surface && !mesh.is_locked(v);
}

// The curve that an edge is a piece of.
std::optional<Index> curve_of(const LiveMesh& mesh, const Shape& shape, Index a, Index b) {
    constexpr double kDistance = 0.1;  // Of the edge.
    constexpr double kCosine = 0.9;
    if (!is_bound(mesh.kind(a)) || !is_bound(mesh.kind(b))) {
        return std::nullopt;
    }
    const Index curve = mesh.kind(a) == ParticleKind::Curve ? mesh.anchor(a) : mesh.anchor(b);
    const bool is_one = mesh.kind(a) == ParticleKind::Corner ||
                        mesh.kind(b) == ParticleKind::Corner || mesh.anchor(b) == curve;
    if (!is_one || curve == kNone) {
        return std::nullopt;
    }
    const Vec3 edge = mesh.point(b) - mesh.point(a);
    const Vec3 middle = 0.5 * (mesh.point(a) + mesh.point(b));
    const auto on = closest_on_curve(shape.features.curves[at(curve)], middle);
    const bool is_piece = (on.point - middle).norm() < kDistance * edge.norm() &&
                          std::abs(on.tangent.dot(edge)) > kCosine * edge.norm();
    return is_piece ? std::optional(curve) : std::nullopt;
}

// A vertex for the middle of a boundary edge; kNone where the kind isn't plain.
Index add_boundary_vertex(LiveMesh& mesh, const Shape& shape, Index a, Index b) {
    const Vec3 middle = 0.5 * (mesh.point(a) + mesh.point(b));
    const auto curve = curve_of(mesh, shape, a, b);
    if (!curve && is_bound(mesh.kind(a)) && is_bound(mesh.kind(b))) {
        return kNone;  // A short curve between corners, or a chord across a narrow patch.
    }
    const auto kind = curve ? ParticleKind::Curve : ParticleKind::Surface;
    const Index facet = mesh.kind(a) == ParticleKind::Surface   ? mesh.anchor(a)
                        : mesh.kind(b) == ParticleKind::Surface ? mesh.anchor(b)
                                                                : kNone;
    const Place place = place_on(shape, kind, curve ? *curve : facet, middle);
    return mesh.add_vertex(place.point, kind, place.anchor, false);
}

void replace_vertex(LiveMesh& mesh, Index t, const std::vector<Index>& gone, Index with) {
    const Tet tet = mesh.tet(t);
    mesh.remove(t);
    for (const Index v : gone) {
        Tet part = tet;
        std::replace(part.begin(), part.end(), v, with);
        mesh.add(part);
    }
}

bool have_one_fan(const LiveMesh& mesh, const Tet& tet) {
    return std::all_of(tet.begin(), tet.end(), [&](Index v) { return mesh.is_one_fan(v); });
}

bool are_joined(const LiveMesh& mesh, Index u, Index w) {
    const auto around = mesh.around(u);
    return std::any_of(around.begin(), around.end(), [&](Index t) { return has(mesh.tet(t), w); });
}

// An edge of the boundary that may go, and its two triangles (a, b, u) and (a, w, b).
std::optional<Ring> ridge(const LiveMesh& mesh, Index a, Index b) {
    const bool is_plain = is_free(mesh, a) || is_free(mesh, b);
    if (!is_plain || mesh.is_locked(a) || mesh.is_locked(b) || !mesh.on_boundary(a) ||
        !mesh.on_boundary(b)) {
        return std::nullopt;
    }
    auto ring = ring_around(mesh, a, b);
    if (!ring || !ring->is_open() || mesh.is_locked(ring->first()) ||
        mesh.is_locked(ring->last())) {
        return std::nullopt;
    }
    return ring;
}

using Face = std::array<Index, 3>;

// Whether the boundary leaves the domain's no more than it did if some faces take others' place.
bool may_replace(const LiveMesh& mesh, const Shape& shape, const std::vector<Face>& old,
                 const std::vector<Face>& made) {
    const auto sum = [&](const std::vector<Face>& faces) {
        double total = 0.0;
        for (const auto& [a, b, c] : faces) {
            total += departure(shape, mesh.point(a), mesh.point(b), mesh.point(c));
        }
        return total;
    };
    const double departs = sum(made);
    return departs == 0.0 || departs <= sum(old);
}

// The two faces of the edge (a, b) may become those of the edge across.
bool may_turn(const LiveMesh& mesh, const Shape& shape, Index a, Index b, const Ring& ring) {
    const Index u = ring.first();
    const Index w = ring.last();
    return may_replace(mesh, shape, {{a, b, u}, {a, w, b}}, {{a, w, u}, {b, u, w}});
}

bool lay_on(LiveMesh& mesh, const Tet& tet) {
    if (dihedral_sine(mesh.point(tet[0]), mesh.point(tet[1]), mesh.point(tet[2]),
                      mesh.point(tet[3])) < kLeastSine) {
        return false;
    }
    mesh.add(tet);
    return have_one_fan(mesh, tet);
}

}  // namespace

bool split_edge(LiveMesh& mesh, const Shape& shape, Index a, Index b) {
    const auto ring = ring_around(mesh, a, b);
    if (!ring || (mesh.is_locked(a) && mesh.is_locked(b))) {
        return false;
    }
    Index middle = kNone;
    if (!ring->is_open()) {
        middle = mesh.add_vertex(0.5 * (mesh.point(a) + mesh.point(b)), ParticleKind::Volume, kNone,
                                 false);
    } else if (mesh.on_boundary(a) && mesh.on_boundary(b) && !mesh.is_locked(a) &&
               !mesh.is_locked(b)) {
        middle = add_boundary_vertex(mesh, shape, a, b);
    }
    if (middle == kNone) {
        return false;
    }
    for (std::size_t i = 0; i < ring->tet_count; ++i) {
        replace_vertex(mesh, ring->tets[i], {a, b}, middle);
    }
    return true;
}

bool split_tet(LiveMesh& mesh, Index t) {
    const Tet tet = mesh.tet(t);
    const Vec3 middle =
        0.25 * (mesh.point(tet[0]) + mesh.point(tet[1]) + mesh.point(tet[2]) + mesh.point(tet[3]));
    const Index v = mesh.add_vertex(middle, ParticleKind::Volume, kNone, false);
    replace_vertex(mesh, t, {tet[0], tet[1], tet[2], tet[3]}, v);
    return true;
}

bool split_face(LiveMesh& mesh, Index t, std::size_t corner) {
    const Tet& tet = mesh.tet(t);
    const auto& face = kFaces[corner];
    const std::vector<Index> face_vertices{tet[face[0]], tet[face[1]], tet[face[2]]};
    Index other = kNone;
    for (const Index s : mesh.around(face_vertices[0])) {
        if (s != t && has(mesh.tet(s), face_vertices[1]) && has(mesh.tet(s), face_vertices[2])) {
            other = s;
        }
    }
    if (other == kNone) {
        return false;
    }
    const Vec3 middle = (mesh.point(face_vertices[0]) + mesh.point(face_vertices[1]) +
                         mesh.point(face_vertices[2])) /
                        3.0;
    const Index v = mesh.add_vertex(middle, ParticleKind::Volume, kNone, false);
    replace_vertex(mesh, t, face_vertices, v);
    replace_vertex(mesh, other, face_vertices, v);
    return true;
}

bool peel_edge(LiveMesh& mesh, const Shape& shape, Index a, Index b) {
    const auto ring = ridge(mesh, a, b);
    if (!ring || ring->tet_count != 1 || mesh.around(a).size() < 2 || mesh.around(b).size() < 2 ||
        !may_turn(mesh, shape, a, b, *ring)) {
        return false;
    }
    const Tet tet = mesh.tet(ring->tets[0]);
    mesh.remove(ring->tets[0]);
    return have_one_fan(mesh, tet);
}

bool fill_valley(LiveMesh& mesh, const Shape& shape, Index a, Index b) {
    const auto ring = ridge(mesh, a, b);
    if (!ring) {
        return false;
    }
    const Index u = ring->first();
    const Index w = ring->last();
    return !are_joined(mesh, u, w) && may_turn(mesh, shape, a, b, *ring) &&
           lay_on(mesh, {a, b, w, u});
}

bool level_vertex(LiveMesh& mesh, const Shape& shape, Index v) {
    std::vector<LinkEdge> fan;
    mesh.boundary_fan(v, fan);
    if (!is_free(mesh, v) || fan.size() != 3) {
        return false;
    }
    const Index a = fan[0].from;
    const Index b = fan[0].to;
    const Index c = fan[1].from == b ? fan[1].to : fan[2].to;
    if (mesh.is_locked(a) || mesh.is_locked(b) || mesh.is_locked(c) ||
        !may_replace(mesh, shape, {{v, a, b}, {v, b, c}, {v, c, a}}, {{a, b, c}})) {
        return false;
    }
    if (mesh.around(v).size() == 1) {
        const Tet tet = mesh.tet(mesh.around(v)[0]);
        mesh.remove(mesh.around(v)[0]);
        return have_one_fan(mesh, tet);
    }
    if (!lay_on(mesh, {v, a, b, c})) {
        return false;
    }
    mesh.bury(v);
    return true;
}

}  // namespace remesh::improve
