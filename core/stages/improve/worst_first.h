#pragma once

#include <cstdint>
#include <vector>

#include "core/run_context.h"
#include "core/stages/improve/bad_tets.h"
#include "core/stages/improve/live_mesh.h"
#include "core/stages/improve/smooth.h"

namespace remesh::improve {

class BoundaryGuard;

struct WorstFirstResult {
    std::int64_t flips = 0;
    std::int64_t collapses = 0;
    std::int64_t splits = 0;
    std::int64_t moves = 0;
    void add(const WorstFirstResult& more) {
        flips += more.flips;
        collapses += more.collapses;
        splits += more.splits;
        moves += more.moves;
    }
    [[nodiscard]] std::int64_t changes() const { return flips + collapses + splits + moves; }
};

/// Raises tets with a dihedral sine below a goal, or with such a boundary triangle (see
/// Star::worst), from the worst up. Whatever is done, the worst of all that it touches gets better.
/// Serial.
///
/// Source of the compound operations: Klingner, Shewchuk, Aggressive tetrahedral mesh improvement,
/// 2007.
class WorstFirst {
public:
    /// \param limit  tets worse than this are worth more effort, <= goal
    /// \param guard  if given, asked before a thorough pass keeps anything
    WorstFirst(LiveMesh& mesh, const Shape& shape, double goal, double limit,
               const BoundaryGuard* guard = nullptr)
        : mesh_(mesh), shape_(shape), goal_(goal), limit_(limit), guard_(guard), bad_(goal) {}

    /// One visit to each bad tet: flips, smoothing, collapses, until one helps.
    WorstFirstResult simple_pass(const RunContext& run);

    /// One visit to each tet that is still worse than the limit and around which something changed
    /// since it was visited: collapses, splits, insertions and changes of the boundary, each
    /// followed by smoothing and flips of all that it touched and taken back unless that helped.
    WorstFirstResult thorough_pass(const RunContext& run);

private:
    LiveMesh& mesh_;
    const Shape& shape_;
    double goal_;
    double limit_;
    const BoundaryGuard* guard_;
    BadTets bad_;
    std::vector<std::int32_t> changed_in_{};  // Per vertex: the last pass that changed its star.
    std::int32_t pass_ = 0;
};

}  // namespace remesh::improve
