#pragma once

#include <vector>

#include "core/run_context.h"
#include "core/stages/improve/live_mesh.h"

namespace remesh::improve {

/// Of a tet and its boundary triangles, as far as below `limit`: the worst dihedral sine, but no
/// more than twice the radius ratio, since needles have fair dihedrals; and the scaled sines of
/// the angles of its boundary triangles.
[[nodiscard]] double score(const LiveMesh& mesh, Index t, double limit);

struct Bad {
    double score;
    Index tet;
};

/// By score, then by number.
void sort_worst_first(std::vector<Bad>& bad);

/// Finds the tets with a score below a goal, again and again while the mesh changes: looks only at
/// those around which something changed since the last time.
class BadTets {
public:
    explicit BadTets(double goal) : goal_(goal) {}

    /// Those below `limit`, which is at most the goal, the worst first. Uses and clears the flags
    /// of Use::Search.
    [[nodiscard]] std::vector<Bad> find(LiveMesh& mesh, double limit, const RunContext& run);

private:
    double goal_;
    bool has_looked_ = false;
    std::vector<Bad> known_{};  // By number.
};

}  // namespace remesh::improve
