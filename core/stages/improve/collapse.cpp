#include "core/stages/improve/collapse.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include "core/stages/improve/measures.h"

namespace remesh::improve {
namespace {

constexpr double kGain = 1.02;            // Least relative rise of the worst element.
constexpr double kNormalCosine = 0.8;     // About 37 degrees.
constexpr double kPoorAngleSine = 0.423;  // 25 degrees: no new triangle below, or below the old.
constexpr double kStraightCosine = 0.9;   // About 26 degrees.
constexpr double kLeastSine = 0.01;       // Of dihedrals, for a start.

double sine_of(const LiveMesh& mesh, const Tet& t) {
    return dihedral_sine(mesh.point(t[0]), mesh.point(t[1]), mesh.point(t[2]), mesh.point(t[3]));
}

using Edge = std::pair<Index, Index>;

// Vertices and edges of the triangles opposite of v, sorted, without repeats.
struct Link {
    std::vector<Index> vertices{};
    std::vector<Edge> edges{};
};

template <typename T>
void sort_unique(std::vector<T>& values) {
    std::sort(values.begin(), values.end());
    values.erase(std::unique(values.begin(), values.end()), values.end());
}

template <typename T>
std::vector<T> common(const std::vector<T>& a, const std::vector<T>& b) {
    std::vector<T> both;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
    return both;
}

Link link_of(const LiveMesh& mesh, Index v) {
    Link link;
    for (const Index t : mesh.around(v)) {
        std::array<Index, 3> rest{};
        std::copy_if(mesh.tet(t).begin(), mesh.tet(t).end(), rest.begin(),
                     [v](Index w) { return w != v; });
        std::sort(rest.begin(), rest.end());
        link.vertices.insert(link.vertices.end(), rest.begin(), rest.end());
        link.edges.insert(link.edges.end(),
                          {{rest[0], rest[1]}, {rest[0], rest[2]}, {rest[1], rest[2]}});
    }
    sort_unique(link.vertices);
    sort_unique(link.edges);
    return link;
}

// Link of the edge (v, w): what the tets at it have besides.
Link link_of(const LiveMesh& mesh, Index v, Index w) {
    Link link;
    for (const Index t : mesh.around(v)) {
        if (!has(mesh.tet(t), w)) {
            continue;
        }
        std::array<Index, 2> rest{};
        std::copy_if(mesh.tet(t).begin(), mesh.tet(t).end(), rest.begin(),
                     [v, w](Index x) { return x != v && x != w; });
        link.vertices.insert(link.vertices.end(), rest.begin(), rest.end());
        link.edges.emplace_back(std::min(rest[0], rest[1]), std::max(rest[0], rest[1]));
    }
    sort_unique(link.vertices);
    sort_unique(link.edges);
    return link;
}

std::vector<Index> fan_vertices(const std::vector<LinkEdge>& fan) {
    std::vector<Index> vertices;
    for (const auto& edge : fan) {
        vertices.push_back(edge.from);
        vertices.push_back(edge.to);
    }
    sort_unique(vertices);
    return vertices;
}

// lk(v) and lk(w) meet in lk(vw) only, both in the tets and on the boundary.
bool keeps_topology(const LiveMesh& mesh, Index v, Index w, const std::vector<LinkEdge>& fan) {
    const Link at_edge = link_of(mesh, v, w);
    const Link at_v = link_of(mesh, v);
    const Link at_w = link_of(mesh, w);
    if (common(at_v.vertices, at_w.vertices) != at_edge.vertices ||
        common(at_v.edges, at_w.edges) != at_edge.edges) {
        return false;
    }
    if (fan.empty()) {
        return true;
    }
    std::vector<LinkEdge> other;
    mesh.boundary_fan(w, other);
    if (common(fan_vertices(fan), fan_vertices(other)).size() != 2) {
        return false;
    }
    // A closed pocket: the triangle that would be left is there already.
    return std::none_of(fan.begin(), fan.end(), [&](const LinkEdge& edge) {
        return std::any_of(other.begin(), other.end(), [&](const LinkEdge& o) {
            return (o.from == edge.from && o.to == edge.to) ||
                   (o.from == edge.to && o.to == edge.from);
        });
    });
}

bool touches(const LinkEdge& edge, Index w) {
    return edge.from == w || edge.to == w;
}

// Whether the fan may be spanned from w instead of v; lowers `worst_new` by its angles.
bool keeps_shape(const LiveMesh& mesh, Index v, Index w, const std::vector<LinkEdge>& fan,
                 double& worst_old, double& worst_new) {
    const Vec3& from = mesh.point(v);
    const Vec3& to = mesh.point(w);
    Vec3 mean = Vec3::Zero();
    double old_sine = 1.0;
    for (const auto& edge : fan) {
        const Vec3& p = mesh.point(edge.from);
        const Vec3& q = mesh.point(edge.to);
        mean += (p - from).cross(q - from);
        old_sine = std::min(old_sine, angle_sine(from, p, q));
    }
    mean.normalize();
    double new_sine = 1.0;
    for (const auto& edge : fan) {
        if (touches(edge, w)) {
            continue;
        }
        const Vec3& p = mesh.point(edge.from);
        const Vec3& q = mesh.point(edge.to);
        if ((p - to).cross(q - to).normalized().dot(mean) < kNormalCosine) {
            return false;
        }
        new_sine = std::min(new_sine, angle_sine(to, p, q));
    }
    worst_old = std::min(worst_old, kTriangleScale * old_sine);
    worst_new = std::min(worst_new, kTriangleScale * new_sine);
    return new_sine >= std::min(old_sine, kPoorAngleSine);
}

bool may_collapse(const LiveMesh& mesh, Index v, Index w, const std::vector<LinkEdge>& fan) {
    if (mesh.is_locked(v) || mesh.is_locked(w)) {
        return false;
    }
    if (mesh.kind(v) == ParticleKind::Volume) {
        return true;
    }
    constexpr std::ptrdiff_t kTrianglesAtEdge = 2;
    return mesh.kind(v) == ParticleKind::Surface &&
           std::count_if(fan.begin(), fan.end(),
                         [w](const LinkEdge& e) { return touches(e, w); }) == kTrianglesAtEdge;
}

struct Contraction {
    std::vector<Index> gone{};
    std::vector<Tet> made{};
    double worst_old = 1.0;
    double worst_new = 1.0;
};

Contraction plan_contraction(const LiveMesh& mesh, Index v, Index w) {
    Contraction plan;
    plan.gone.assign(mesh.around(v).begin(), mesh.around(v).end());
    for (const Index t : plan.gone) {
        Tet tet = mesh.tet(t);
        plan.worst_old = std::min(plan.worst_old, sine_of(mesh, tet));
        if (!has(tet, w)) {
            std::replace(tet.begin(), tet.end(), v, w);
            plan.worst_new = std::min(plan.worst_new, sine_of(mesh, tet));
            plan.made.push_back(tet);
        }
    }
    return plan;
}

void apply(LiveMesh& mesh, const Contraction& plan) {
    for (const Index t : plan.gone) {
        mesh.remove(t);
    }
    for (const auto& tet : plan.made) {
        mesh.add(tet);
    }
}

// Whether (v, w) is a piece of v's curve, which goes on nearly straight behind v.
bool runs_along_curve(const LiveMesh& mesh, Index v, Index w, const std::vector<LinkEdge>& fan) {
    const auto is_bound = [&](Index x) {
        return mesh.kind(x) == ParticleKind::Corner ||
               (mesh.kind(x) == ParticleKind::Curve && mesh.anchor(x) == mesh.anchor(v));
    };
    std::vector<Index> ends = fan_vertices(fan);
    std::erase_if(ends, [&](Index x) { return !is_bound(x); });
    if (ends.size() != 2 || (ends[0] != w && ends[1] != w)) {
        return false;
    }
    const Vec3 before = (mesh.point(v) - mesh.point(ends[0])).normalized();
    const Vec3 behind = (mesh.point(ends[1]) - mesh.point(v)).normalized();
    return before.dot(behind) > kStraightCosine;
}

// On one side of the curve each, so that the triangles tell which.
bool keep_facing(const LiveMesh& mesh, Index v, Index w, const std::vector<LinkEdge>& fan) {
    const Vec3& from = mesh.point(v);
    const Vec3& to = mesh.point(w);
    return std::all_of(fan.begin(), fan.end(), [&](const LinkEdge& edge) {
        const Vec3& p = mesh.point(edge.from);
        const Vec3& q = mesh.point(edge.to);
        const Vec3 now = (p - from).cross(q - from).normalized();
        return touches(edge, w) || (p - to).cross(q - to).normalized().dot(now) > kNormalCosine;
    });
}

// Whether the boundary leaves the domain's no more than before.
bool follows_domain(const LiveMesh& mesh, const Shape& shape, Index v, Index w,
                    const std::vector<LinkEdge>& fan) {
    if (mesh.kind(v) == ParticleKind::Curve) {
        return keep_facing(mesh, v, w, fan);
    }
    double now = 0.0;
    double then = 0.0;
    for (const auto& [p, q] : fan) {
        if (!touches({p, q}, w)) {
            then += departure(shape, mesh.point(w), mesh.point(p), mesh.point(q));
        }
    }
    for (std::size_t i = 0; i < fan.size() && then > now; ++i) {
        now += departure(shape, mesh.point(v), mesh.point(fan[i].from), mesh.point(fan[i].to));
    }
    return then <= now;
}

}  // namespace

bool collapse_edge(LiveMesh& mesh, Index v, Index w) {
    std::vector<LinkEdge> fan;
    if (mesh.on_boundary(v)) {
        mesh.boundary_fan(v, fan);
    }
    if (!may_collapse(mesh, v, w, fan)) {
        return false;
    }
    auto plan = plan_contraction(mesh, v, w);
    if (plan.made.empty() || !keeps_shape(mesh, v, w, fan, plan.worst_old, plan.worst_new) ||
        plan.worst_new <= std::max(plan.worst_old, 0.0) * kGain + 1e-6 ||
        !keeps_topology(mesh, v, w, fan)) {
        return false;
    }
    apply(mesh, plan);
    return true;
}

bool contract_edge(LiveMesh& mesh, const Shape& shape, Index v, Index w) {
    std::vector<LinkEdge> fan;
    if (mesh.on_boundary(v)) {
        mesh.boundary_fan(v, fan);
    }
    const bool is_legal =
        mesh.kind(v) == ParticleKind::Curve
            ? !mesh.is_locked(v) && !mesh.is_locked(w) && runs_along_curve(mesh, v, w, fan)
            : may_collapse(mesh, v, w, fan);
    if (!is_legal) {
        return false;
    }
    const auto plan = plan_contraction(mesh, v, w);
    if (plan.made.empty() || plan.worst_new < kLeastSine || !keeps_topology(mesh, v, w, fan) ||
        !follows_domain(mesh, shape, v, w, fan)) {
        return false;
    }
    apply(mesh, plan);
    return true;
}

}  // namespace remesh::improve
