#include "core/stages/improve/worst_first.h"

#include <algorithm>
#include <array>

#include "core/stages/improve/bad_tets.h"
#include "core/stages/improve/boundary_guard.h"
#include "core/stages/improve/collapse.h"
#include "core/stages/improve/flips.h"
#include "core/stages/improve/measures.h"
#include "core/stages/improve/raise.h"
#include "core/stages/improve/surgery.h"

namespace remesh::improve {
namespace {

constexpr double kPower = 9.0;  // Steep, so that the worst tets of a star rule its energy.
constexpr std::size_t kBlock = 64;

// Operations on one bad tet.
class Visit {
public:
    Visit(LiveMesh& mesh, const Shape& shape, const BoundaryGuard* guard, double goal, double limit,
          WorstFirstResult& result)
        : mesh_(mesh),
          shape_(shape),
          guard_(guard),
          goal_(goal),
          limit_(limit),
          star_(kPower, 1.0),
          result_(result) {}

    void simply(Index t) {
        if (flip_tet(mesh_, t, Judge::DihedralSine)) {
            ++result_.flips;
        } else if (!(smooth(t) && score(mesh_, t, goal_) >= goal_) && collapse(t)) {
            ++result_.collapses;
        }
    }

    // Returns whether something helped; `touched()` says what it changed.
    bool thoroughly(Index t) {
        const Tet tet = mesh_.tet(t);
        look_around(tet);
        for (const auto& [i, j] : kEdges) {
            const Index v = tet[i];
            const Index w = tet[j];
            if (attempt(t, [&] { return contract_edge(mesh_, shape_, v, w); }) ||
                attempt(t, [&] { return contract_edge(mesh_, shape_, w, v); })) {
                ++result_.collapses;
                return true;
            }
        }
        if (reshape_boundary(t, tet)) {
            ++result_.flips;
            return true;
        }
        if (insert(t, tet)) {
            ++result_.splits;
            return true;
        }
        return false;
    }

    [[nodiscard]] const std::vector<Index>& touched() const { return touched_; }
    [[nodiscard]] std::int64_t attempts() const { return attempts_; }

private:
    bool smooth(Index t) {
        const Tet tet = mesh_.tet(t);
        const auto effort = score(mesh_, t, goal_) < limit_ ? Effort::Full : Effort::Newton;
        bool has_moved = false;
        for (const Index v : tet) {
            if (raise_worst(mesh_, shape_, v, effort, star_)) {
                has_moved = true;
                ++result_.moves;
            }
        }
        return has_moved;
    }

    bool collapse(Index t) {
        const Tet tet = mesh_.tet(t);
        return std::any_of(kEdges.begin(), kEdges.end(), [&](const auto& edge) {
            return collapse_edge(mesh_, tet[edge[0]], tet[edge[1]]) ||
                   collapse_edge(mesh_, tet[edge[1]], tet[edge[0]]);
        });
    }

    bool reshape_boundary(Index t, const Tet& tet) {
        for (const Index v : tet) {
            if (mesh_.kind(v) == ParticleKind::Surface &&
                attempt(t, [&] { return level_vertex(mesh_, shape_, v); })) {
                return true;
            }
        }
        return std::any_of(kEdges.begin(), kEdges.end(), [&](const auto& edge) {
            const Index a = tet[edge[0]];
            const Index b = tet[edge[1]];
            return mesh_.on_boundary(a) && mesh_.on_boundary(b) &&
                   (attempt(t, [&] { return peel_edge(mesh_, shape_, a, b); }) ||
                    attempt(t, [&] { return fill_valley(mesh_, shape_, a, b); }));
        });
    }

    // New vertices: on edges from the longest down, inside, on faces.
    bool insert(Index t, const Tet& tet) {
        auto edges = kEdges;
        const auto length = [&](const std::array<std::size_t, 2>& e) {
            return (mesh_.point(tet[e[0]]) - mesh_.point(tet[e[1]])).squaredNorm();
        };
        std::stable_sort(edges.begin(), edges.end(),
                         [&](const auto& a, const auto& b) { return length(a) > length(b); });
        for (const auto& edge : edges) {
            if (attempt(t, [&] { return split_edge(mesh_, shape_, tet[edge[0]], tet[edge[1]]); })) {
                return true;
            }
        }
        if (attempt(t, [&] { return split_tet(mesh_, t); })) {
            return true;
        }
        for (std::size_t corner = 0; corner < 4; ++corner) {
            if (attempt(t, [&] { return split_face(mesh_, t, corner); })) {
                return true;
            }
        }
        return false;
    }

    // Keeps what an operation and what follows from it do if the worst element gets better.
    template <typename Operation>
    bool attempt(Index t, Operation operation) {
        constexpr double kGain = 1.02;
        const double old = std::max(score(mesh_, t, goal_), 0.0);
        mesh_.begin();
        ++attempts_;
        if (operation() && settle() > old * kGain + 1e-4 && is_boundary_sound() &&
            (guard_ == nullptr || guard_->allows(mesh_, touched_))) {
            mesh_.commit();
            return true;
        }
        mesh_.roll_back();
        return false;
    }

    // Smooths and flips the worst of all that was touched. Returns the worst that is left.
    double settle() {
        constexpr int kRounds = 4;
        constexpr std::size_t kWorst = 6;
        for (int round = 0; round < kRounds; ++round) {
            find_bad();
            bool has_changed = false;
            for (std::size_t i = 0; i < std::min(kWorst, bad_.size()); ++i) {
                const Index t = bad_[i].tet;
                if (!mesh_.is_alive(t)) {
                    continue;
                }
                if (flip_tet(mesh_, t, Judge::DihedralSine)) {
                    has_changed = true;
                    continue;
                }
                const Tet tet = mesh_.tet(t);
                for (const Index v : tet) {
                    has_changed = raise_worst(mesh_, shape_, v, Effort::Full, star_) || has_changed;
                }
            }
            if (!has_changed) {
                break;
            }
        }
        find_bad();
        return bad_.empty() ? goal_ : bad_.front().score;
    }

    // Smoothing and flips judge angles only: they might fold the boundary over.
    bool is_boundary_sound() {
        return departure_of(touched_) == 0.0 ||
               departure_of(tets_around(region_, touched_)) <= departed_ + 1e-9;
    }

    // Sum over the boundary faces of some tets.
    [[nodiscard]] double departure_of(const std::vector<Index>& tets) const {
        double sum = 0.0;
        for (const Index t : tets) {
            const auto& tet = mesh_.tet(t);
            for (std::size_t corner = 0; corner < 4; ++corner) {
                const Index a = tet[kFaces[corner][0]];
                const Index b = tet[kFaces[corner][1]];
                const Index c = tet[kFaces[corner][2]];
                if (mesh_.is_boundary_face(t, corner)) {
                    sum += departure(shape_, mesh_.point(a), mesh_.point(b), mesh_.point(c));
                }
            }
        }
        return sum;
    }

    // Tets at some vertices, and `more`, without repeats.
    [[nodiscard]] std::vector<Index> tets_around(const std::vector<Index>& vertices,
                                                 std::vector<Index> more) const {
        for (const Index v : vertices) {
            const auto around = mesh_.around(v);
            more.insert(more.end(), around.begin(), around.end());
        }
        std::sort(more.begin(), more.end());
        more.erase(std::unique(more.begin(), more.end()), more.end());
        return more;
    }

    // Where an operation on a tet may change the boundary, and what that is like now.
    void look_around(const Tet& tet) {
        region_.clear();
        for (const Index t : tets_around({tet.begin(), tet.end()}, {})) {
            region_.insert(region_.end(), mesh_.tet(t).begin(), mesh_.tet(t).end());
        }
        std::sort(region_.begin(), region_.end());
        region_.erase(std::unique(region_.begin(), region_.end()), region_.end());
        departed_ = departure_of(tets_around(region_, {}));
    }

    void find_bad() {
        mesh_.touched(touched_);
        bad_.clear();
        for (const Index t : touched_) {
            const double worst = score(mesh_, t, goal_);
            if (worst < goal_) {
                bad_.push_back({worst, t});
            }
        }
        sort_worst_first(bad_);
    }

    LiveMesh& mesh_;
    const Shape& shape_;
    const BoundaryGuard* guard_;
    double goal_;
    double limit_;
    Star star_;
    WorstFirstResult& result_;
    std::vector<Index> touched_{};
    std::vector<Bad> bad_{};
    std::int64_t attempts_ = 0;
    std::vector<Index> region_{};  // Vertices around the tet of a thorough visit,
    double departed_ = 0.0;        // and by how much the boundary there left the domain's.
};

}  // namespace

WorstFirstResult WorstFirst::simple_pass(const RunContext& run) {
    WorstFirstResult result;
    Visit visit(mesh_, shape_, guard_, goal_, limit_, result);
    const auto bad = bad_.find(mesh_, goal_, run);
    for (std::size_t i = 0; i < bad.size(); ++i) {
        if (i % kBlock == 0) {
            run.checkpoint();
        }
        const Index t = bad[i].tet;
        if (mesh_.is_alive(t) && score(mesh_, t, goal_) < goal_) {
            visit.simply(t);
        }
    }
    return result;
}

WorstFirstResult WorstFirst::thorough_pass(const RunContext& run) {
    WorstFirstResult result;
    Visit visit(mesh_, shape_, guard_, goal_, limit_, result);
    ++pass_;
    const auto is_due = [&](Index t) {
        const auto& tet = mesh_.tet(t);
        return std::any_of(tet.begin(), tet.end(), [&](Index v) {
            return at(v) >= changed_in_.size() || changed_in_[at(v)] >= pass_ - 1;
        });
    };
    // Where much is bad, what can be raised is found in time; the rest isn't worth hours.
    const auto budget = static_cast<std::int64_t>(500 + mesh_.slot_count() / 100);
    for (const auto& bad : bad_.find(mesh_, limit_, run)) {
        run.checkpoint();
        if (visit.attempts() > budget) {
            break;
        }
        const Index t = bad.tet;
        if (!mesh_.is_alive(t) || !is_due(t) || score(mesh_, t, limit_) >= limit_ ||
            !visit.thoroughly(t)) {
            continue;
        }
        changed_in_.resize(mesh_.vertex_count(), pass_);
        for (const Index s : visit.touched()) {
            for (const Index v : mesh_.tet(s)) {
                changed_in_[at(v)] = pass_;
            }
        }
    }
    changed_in_.resize(mesh_.vertex_count(), 0);
    return result;
}

}  // namespace remesh::improve
