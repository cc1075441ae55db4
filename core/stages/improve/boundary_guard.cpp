#include "core/stages/improve/boundary_guard.h"

#include <algorithm>
#include <array>

#include "core/exact/intersections.h"

namespace remesh::improve {
namespace {

bool meet(const Box& a, const Box& b) {
    return (a.low.array() <= b.high.array()).all() && (b.low.array() <= a.high.array()).all();
}

template <typename Range, typename PointOf>
Box box_of(const Range& range, PointOf point_of) {
    Box box;
    for (const auto& item : range) {
        box.include(point_of(item));
    }
    return box;
}

bool may_change(const LiveMesh& mesh, Index t, std::size_t corner) {
    const auto& tet = mesh.tet(t);
    const auto& face = kFaces[corner];
    return (!mesh.is_locked(tet[face[0]]) || !mesh.is_locked(tet[face[1]]) ||
            !mesh.is_locked(tet[face[2]])) &&
           mesh.is_boundary_face(t, corner);
}

}  // namespace

BoundaryGuard::BoundaryGuard(const Whole& whole, const Part& part)
    : origin_(part.origin), whole_count_(index(whole.mesh.vertices.size())) {
    std::vector<std::uint8_t> moves(whole.mesh.vertices.size(), 0);
    for (std::size_t v = 0; v < origin_.size(); ++v) {
        moves[at(origin_[v])] = part.mesh.is_locked(index(v)) ? 0 : 1;
    }
    const auto& points = whole.mesh.vertices;
    for (const Triangle& t : boundary_of(whole.mesh.tets)) {
        if (moves[at(t[0])] == 0 && moves[at(t[1])] == 0 && moves[at(t[2])] == 0) {
            still_.push_back({{points[at(t[0])], points[at(t[1])], points[at(t[2])]}, t});
        }
    }
}

BoundaryGuard::Face BoundaryGuard::face_of(const LiveMesh& mesh, Index t,
                                           std::size_t corner) const {
    Face face;
    for (std::size_t k = 0; k < 3; ++k) {
        const Index v = mesh.tet(t)[kFaces[corner][k]];
        face.corners[k] = mesh.point(v);
        face.ids[k] =
            at(v) < origin_.size() ? origin_[at(v)] : whole_count_ + (v - index(origin_.size()));
    }
    return face;
}

void BoundaryGuard::add_faces_near(const LiveMesh& mesh, const Box& box,
                                   std::vector<Face>& faces) const {
    for (std::size_t i = 0; i < mesh.slot_count(); ++i) {
        const Index t = index(i);
        if (!mesh.is_alive(t)) {
            continue;
        }
        const Box around =
            box_of(mesh.tet(t), [&](Index v) -> const Vec3& { return mesh.point(v); });
        for (std::size_t corner = 0; corner < 4 && meet(box, around); ++corner) {
            if (may_change(mesh, t, corner)) {
                faces.push_back(face_of(mesh, t, corner));
            }
        }
    }
}

bool BoundaryGuard::allows(const LiveMesh& mesh, const std::vector<Index>& tets) const {
    Box box;
    for (const Index t : tets) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            if (may_change(mesh, t, corner)) {
                for (const Vec3& x : face_of(mesh, t, corner).corners) {
                    box.include(x);
                }
            }
        }
    }
    if (box.is_empty()) {
        return true;
    }
    std::vector<Face> faces;
    add_faces_near(mesh, box, faces);
    std::copy_if(still_.begin(), still_.end(), std::back_inserter(faces), [&](const Face& face) {
        return meet(box, box_of(face.corners, [](const Vec3& x) { return x; }));
    });

    std::vector<Index> ids;
    for (const Face& face : faces) {
        ids.insert(ids.end(), face.ids.begin(), face.ids.end());
    }
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    Points points(ids.size());
    std::vector<Triangle> triangles(faces.size());
    for (std::size_t f = 0; f < faces.size(); ++f) {
        for (std::size_t k = 0; k < 3; ++k) {
            const auto found = std::lower_bound(ids.begin(), ids.end(), faces[f].ids[k]);
            triangles[f][k] = index(static_cast<std::size_t>(found - ids.begin()));
            points[at(triangles[f][k])] = faces[f].corners[k];
        }
    }
    return self_intersections(points, triangles).empty();
}

}  // namespace remesh::improve
