#pragma once

#include <cstdint>
#include <vector>

#include "core/stages/carve.h"
#include "core/stages/improve.h"
#include "core/stages/improve/live_mesh.h"

namespace remesh::improve {

/// The tets near the boundary and the bad ones elsewhere, cut out of a mesh: all others are fine
/// and stay as they are. Numbered along a space-filling curve.
struct Part {
    LiveMesh mesh{};
    std::vector<Index> origin{};  ///< Vertex of the whole mesh of each vertex of the part.
    std::vector<std::uint8_t> is_inside{};  ///< Per tet of the whole mesh.
};

/// \param frozen  per vertex of the whole mesh: must neither move nor go
/// \param limit   tets with a radius ratio below this are bad
[[nodiscard]] Part cut_part(const CarveResult& whole, const std::vector<Index>& anchor,
                            const std::vector<std::uint8_t>& frozen, double limit,
                            const RunContext& run);

/// The whole mesh with the part put back: the same vertices, then those that were inserted.
struct Assembled {
    TetMesh mesh{};
    std::vector<ParticleKind> kind{};
    std::vector<Index> anchor{};
};
[[nodiscard]] Assembled put_back(const CarveResult& whole, const std::vector<Index>& anchor,
                                 const Part& part);

}  // namespace remesh::improve
