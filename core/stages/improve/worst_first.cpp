#include "core/stages/improve/worst_first.h"

#include <algorithm>
#include <array>

#include "core/stages/improve/collapse.h"
#include "core/stages/improve/flips.h"
#include "core/stages/improve/measures.h"

namespace remesh::improve {
namespace {

constexpr double kPower = 9.0;  // Steep, so that the worst tets of a star rule its energy.

constexpr std::array<std::array<std::size_t, 2>, 6> kEdges{
    {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

double tet_sine(const LiveMesh& mesh, const Tet& t) {
    return dihedral_sine(mesh.point(t[0]), mesh.point(t[1]), mesh.point(t[2]), mesh.point(t[3]));
}

bool is_boundary_face(const LiveMesh& mesh, Index t, std::size_t corner) {
    const auto& tet = mesh.tet(t);
    const Index a = tet[kFaces[corner][0]];
    const Index b = tet[kFaces[corner][1]];
    const Index c = tet[kFaces[corner][2]];
    if (!mesh.on_boundary(a) || !mesh.on_boundary(b) || !mesh.on_boundary(c)) {
        return false;
    }
    const auto around = mesh.around(a);
    return std::none_of(around.begin(), around.end(), [&](Index s) {
        return s != t && has(mesh.tet(s), b) && has(mesh.tet(s), c);
    });
}

// Of a tet and its boundary triangles, as far as below `limit`.
double score(const LiveMesh& mesh, Index t, double limit) {
    const auto& tet = mesh.tet(t);
    double worst = tet_sine(mesh, tet);
    for (std::size_t corner = 0; corner < 4; ++corner) {
        const Index a = tet[kFaces[corner][0]];
        const Index b = tet[kFaces[corner][1]];
        const Index c = tet[kFaces[corner][2]];
        if (!mesh.on_boundary(a) || !mesh.on_boundary(b) || !mesh.on_boundary(c)) {
            continue;
        }
        const double sine =
            kTriangleScale * angle_sine(mesh.point(a), mesh.point(b), mesh.point(c));
        if (sine < std::min(worst, limit) && is_boundary_face(mesh, t, corner)) {
            worst = sine;
        }
    }
    return worst;
}

struct Bad {
    double score;
    Index tet;
};

std::vector<Bad> bad_tets(const LiveMesh& mesh, double goal) {
    std::vector<Bad> bad;
    for (std::size_t i = 0; i < mesh.slot_count(); ++i) {
        if (mesh.is_alive(index(i))) {
            const double worst = score(mesh, index(i), goal);
            if (worst < goal) {
                bad.push_back({worst, index(i)});
            }
        }
    }
    std::sort(bad.begin(), bad.end(), [](const Bad& a, const Bad& b) {
        return a.score != b.score ? a.score < b.score : a.tet < b.tet;
    });
    return bad;
}

class WorstFirst {
public:
    WorstFirst(LiveMesh& mesh, const Shape& shape, double goal)
        : mesh_(mesh), shape_(shape), goal_(goal), star_(kPower, 1.0) {}

    void visit(Index t) {
        if (flip_tet(mesh_, t, Judge::DihedralSine)) {
            ++result_.flips;
            return;
        }
        if (smooth(t) && score(mesh_, t, goal_) >= goal_) {
            return;
        }
        if (collapse(t)) {
            ++result_.collapses;
            return;
        }
        if (split(t)) {
            ++result_.splits;
        }
    }

    [[nodiscard]] WorstFirstResult& result() { return result_; }

private:
    bool smooth(Index t) {
        const Tet tet = mesh_.tet(t);
        bool has_moved = false;
        for (const Index v : tet) {
            if (raise_worst(mesh_, shape_, v, kTriangleScale, star_)) {
                has_moved = true;
                ++result_.moves;
            }
        }
        return has_moved;
    }

    bool collapse(Index t) {
        const Tet tet = mesh_.tet(t);
        for (const auto& edge : kEdges) {
            if (collapse_edge(mesh_, tet[edge[0]], tet[edge[1]], kTriangleScale) ||
                collapse_edge(mesh_, tet[edge[1]], tet[edge[0]], kTriangleScale)) {
                return true;
            }
        }
        return false;
    }

    // From the longest edge down.
    bool split(Index t) {
        const Tet tet = mesh_.tet(t);
        auto edges = kEdges;
        const auto length = [&](const std::array<std::size_t, 2>& e) {
            return (mesh_.point(tet[e[0]]) - mesh_.point(tet[e[1]])).squaredNorm();
        };
        std::stable_sort(edges.begin(), edges.end(),
                         [&](const auto& a, const auto& b) { return length(a) > length(b); });
        return std::any_of(edges.begin(), edges.begin() + 3, [&](const auto& edge) {
            return split_edge(tet[edge[0]], tet[edge[1]]);
        });
    }

    bool split_edge(Index a, Index b) {
        std::vector<Index> ring;
        bool is_open = false;
        for (const Index t : mesh_.around(a)) {
            if (!has(mesh_.tet(t), b)) {
                continue;
            }
            ring.push_back(t);
            for (std::size_t corner = 0; corner < 4; ++corner) {
                const Index opposite = mesh_.tet(t)[corner];
                is_open = is_open ||
                          (opposite != a && opposite != b && is_boundary_face(mesh_, t, corner));
            }
        }
        if (mesh_.is_locked(a) || mesh_.is_locked(b) || is_open) {
            return false;
        }
        double old = 1.0;
        for (const Index t : ring) {
            old = std::min(old, score(mesh_, t, goal_));
        }
        mesh_.begin();
        const Index middle = mesh_.add_vertex(0.5 * (mesh_.point(a) + mesh_.point(b)),
                                              ParticleKind::Volume, kNone, false);
        for (const Index t : ring) {
            Tet at_a = mesh_.tet(t);
            Tet at_b = at_a;
            std::replace(at_a.begin(), at_a.end(), b, middle);
            std::replace(at_b.begin(), at_b.end(), a, middle);
            mesh_.remove(t);
            mesh_.add(at_a);
            mesh_.add(at_b);
        }
        if (settle(middle) > old * 1.05) {
            mesh_.commit();
            return true;
        }
        mesh_.roll_back();
        return false;
    }

    // Smooths and flips around a new vertex. Returns the worst of all new tets.
    double settle(Index v) {
        constexpr int kRounds = 2;
        for (int round = 0; round < kRounds; ++round) {
            raise_worst(mesh_, shape_, v, kTriangleScale, star_);
            for (const Index t : mesh_.added()) {
                if (mesh_.is_alive(t) && tet_sine(mesh_, mesh_.tet(t)) < goal_) {
                    flip_tet(mesh_, t, Judge::DihedralSine);
                }
            }
        }
        raise_worst(mesh_, shape_, v, kTriangleScale, star_);
        double worst = 1.0;
        for (const Index t : mesh_.added()) {
            worst = std::min(worst, score(mesh_, t, goal_));
        }
        return worst;
    }

    LiveMesh& mesh_;
    const Shape& shape_;
    double goal_;
    Star star_;
    WorstFirstResult result_;
};

}  // namespace

WorstFirstResult raise_worst_elements(LiveMesh& mesh, const Shape& shape, double goal,
                                      const RunContext& run) {
    constexpr std::size_t kBlock = 64;
    WorstFirst pass(mesh, shape, goal);
    const auto bad = bad_tets(mesh, goal);
    pass.result().bad = static_cast<std::int64_t>(bad.size());
    for (std::size_t i = 0; i < bad.size(); ++i) {
        if (i % kBlock == 0) {
            run.checkpoint();
        }
        const Index t = bad[i].tet;
        if (mesh.is_alive(t) && score(mesh, t, goal) < goal) {
            pass.visit(t);
        }
    }
    return pass.result();
}

}  // namespace remesh::improve
