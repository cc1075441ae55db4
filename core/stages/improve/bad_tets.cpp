#include "core/stages/improve/bad_tets.h"

#include <algorithm>
#include <iterator>

#include "core/parallel.h"
#include "core/stages/improve/measures.h"

namespace remesh::improve {
namespace {

double tet_score(const LiveMesh& mesh, const Tet& t) {
    const Vec3& a = mesh.point(t[0]);
    const Vec3& b = mesh.point(t[1]);
    const Vec3& c = mesh.point(t[2]);
    const Vec3& d = mesh.point(t[3]);
    return std::min(dihedral_sine(a, b, c, d), 2.0 * tet_radius_ratio(a, b, c, d));
}

}  // namespace

double score(const LiveMesh& mesh, Index t, double limit) {
    const auto& tet = mesh.tet(t);
    double worst = mesh.tet_scale() * tet_score(mesh, tet);
    for (std::size_t corner = 0; corner < 4; ++corner) {
        const Index a = tet[kFaces[corner][0]];
        const Index b = tet[kFaces[corner][1]];
        const Index c = tet[kFaces[corner][2]];
        if (!mesh.on_boundary(a) || !mesh.on_boundary(b) || !mesh.on_boundary(c)) {
            continue;  // Faster than to ask for the sine.
        }
        const double sine =
            kTriangleScale * angle_sine(mesh.point(a), mesh.point(b), mesh.point(c));
        if (sine < std::min(worst, limit) && mesh.is_boundary_face(t, corner)) {
            worst = sine;
        }
    }
    return worst;
}

void sort_worst_first(std::vector<Bad>& bad) {
    std::sort(bad.begin(), bad.end(), [](const Bad& a, const Bad& b) {
        return a.score != b.score ? a.score < b.score : a.tet < b.tet;
    });
}

std::vector<Bad> BadTets::find(LiveMesh& mesh, double limit, const RunContext& run) {
    constexpr std::size_t kBlock = 8192;
    const auto is_due = [&](const Tet& tet) {
        return !has_looked_ || std::any_of(tet.begin(), tet.end(), [&](Index v) {
            return mesh.has_changed(v, LiveMesh::Use::Search);
        });
    };
    const std::size_t slots = mesh.slot_count();
    std::vector<std::vector<Bad>> blocks((slots + kBlock - 1) / kBlock);
    for_each_block(slots, kBlock, run, [&](std::size_t begin, std::size_t end) {
        auto& found = blocks[begin / kBlock];
        auto known = std::lower_bound(known_.begin(), known_.end(), index(begin),
                                      [](const Bad& bad, Index t) { return bad.tet < t; });
        for (std::size_t i = begin; i < end; ++i) {
            const Index t = index(i);
            const bool is_known = known != known_.end() && known->tet == t;
            if (mesh.is_alive(t)) {
                if (is_due(mesh.tet(t))) {
                    const double worst = score(mesh, t, goal_);
                    if (worst < goal_) {
                        found.push_back({worst, t});
                    }
                } else if (is_known) {
                    found.push_back(*known);
                }
            }
            known += is_known ? 1 : 0;
        }
    });
    known_.clear();
    for (const auto& block : blocks) {
        known_.insert(known_.end(), block.begin(), block.end());
    }
    for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
        mesh.set_changed(index(v), false, LiveMesh::Use::Search);
    }
    has_looked_ = true;

    std::vector<Bad> bad;
    std::copy_if(known_.begin(), known_.end(), std::back_inserter(bad),
                 [&](const Bad& b) { return b.score < limit; });
    sort_worst_first(bad);
    return bad;
}

}  // namespace remesh::improve
