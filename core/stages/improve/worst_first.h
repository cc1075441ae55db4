#pragma once

#include <cstdint>

#include "core/run_context.h"
#include "core/stages/improve/live_mesh.h"
#include "core/stages/improve/smooth.h"

namespace remesh::improve {

struct WorstFirstResult {
    std::int64_t flips = 0;
    std::int64_t collapses = 0;
    std::int64_t splits = 0;
    std::int64_t moves = 0;
    std::int64_t bad = 0;  ///< Elements below the goal before the pass.
    [[nodiscard]] std::int64_t changes() const { return flips + collapses + splits + moves; }
};

/// Visits all tets with a dihedral sine below `goal`, or with such a boundary triangle, from the
/// worst up, and tries on each flips, smoothing, collapses and splits until one helps. Whatever is
/// done, the worst of all that it touches gets better. Serial.
WorstFirstResult raise_worst_elements(LiveMesh& mesh, const Shape& shape, double goal,
                                      const RunContext& run);

}  // namespace remesh::improve
