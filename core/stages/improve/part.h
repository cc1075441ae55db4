#pragma once

#include <cstdint>
#include <vector>

#include "core/run_context.h"
#include "core/stages/improve/live_mesh.h"

namespace remesh::improve {

/// A mesh that parts are cut out of.
struct Whole {
    const TetMesh& mesh;
    const std::vector<ParticleKind>& kind;  ///< #V.
    const std::vector<Index>& anchor;       ///< At least #V.
};

/// Which tets to cut out.
struct Cut {
    std::vector<std::uint8_t> is_inside{};  ///< Per tet.
    std::vector<std::uint8_t> is_locked{};  ///< Per vertex: must neither move nor go. All vertices
                                            ///< that have tets outside are.
};

/// The tets near the boundary and the bad ones elsewhere: all others are fine and stay as they are.
/// \param frozen  per vertex: to be locked
/// \param limit   tets with a radius ratio below this are bad
[[nodiscard]] Cut near_boundary(const Whole& whole, const std::vector<std::uint8_t>& frozen,
                                double limit, const RunContext& run);

/// The tets at the boundary and one step further in, for the sake of the boundary's triangles.
[[nodiscard]] Cut at_boundary(const Whole& whole, const std::vector<std::uint8_t>& frozen);

/// All tets at some vertices, of which no others move.
[[nodiscard]] Cut around(const Whole& whole, const std::vector<std::uint8_t>& wanted);

/// Tets cut out of a mesh, numbered along a space-filling curve.
struct Part {
    LiveMesh mesh{};
    std::vector<Index> origin{};  ///< Vertex of the whole mesh of each vertex of the part.
    std::vector<std::uint8_t> is_inside{};  ///< Per tet of the whole mesh.
};
/// \param tet_scale  see LiveMesh
[[nodiscard]] Part cut_part(const Whole& whole, Cut cut, double tet_scale = 1.0);

/// The whole mesh with the part put back: the same vertices, then those that were inserted.
struct Assembled {
    TetMesh mesh{};
    std::vector<ParticleKind> kind{};
    std::vector<Index> anchor{};
};
[[nodiscard]] Assembled put_back(const Whole& whole, const Part& part);

}  // namespace remesh::improve
