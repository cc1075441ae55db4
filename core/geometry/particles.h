#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/lattice.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// What a particle may do. A number of the paper's hierarchy: more is more bound.
enum class ParticleKind : std::uint8_t {
    Volume = 0,   ///< Moves freely inside.
    Surface = 1,  ///< Snapped to the boundary, slides on it.
    Curve = 2,    ///< Slides along a feature curve.
    Corner = 3,   ///< Fixed.
};

/// Surface particles whose normals have a cosine below this are on two sides of a thin sheet.
inline constexpr double kOpposed = -0.2;

/// Sample points while they relax: a structure of arrays of the same length #P.
struct Particles {
    Points position{};  ///< Model units.
    std::vector<ParticleKind> kind{};
    std::vector<Index>
        anchor{};  ///< Surface: facet of the domain's boundary. Curve: the curve. Else kNone.
    std::vector<double> h{};  ///< Wanted spacing at the particle, model units.
    Points normal{};          ///< Surface: outward normal. Curve: tangent. Else zero.
    Lattice lattice{};        ///< Of which volume particles were sites, before they relaxed.

    [[nodiscard]] std::size_t size() const { return position.size(); }
    void add(const Vec3& x, ParticleKind k, Index where, double spacing, const Vec3& n) {
        position.push_back(x);
        kind.push_back(k);
        anchor.push_back(where);
        h.push_back(spacing);
        normal.push_back(n);
    }
};

}  // namespace remesh
