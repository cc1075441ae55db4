#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/exact/delaunay.h"
#include "core/geometry/domain.h"
#include "core/geometry/lipschitz_field.h"
#include "core/geometry/particles.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"

namespace remesh {

/// Demands for sizes, and how the paper's diffusion takes them into the volume: c = ln(h_max / h)
/// is held where something asks for a size and on the boundary, and dc/dt = div grad c + R c
/// elsewhere. A map that comes of it is used as samples that h may rise from by the gradation, so
/// that it stays exactly as Lipschitz as the demands.
struct MapToSpread {
    LipschitzField demands;  ///< Of what has no growth of its own.
    double gradation = 0.2;  ///< Steepest that h may get, > 0.
    double reaction = -1.0;  ///< R, 1 / (model unit)^2, < 0.
};

/// R for which the map is about as steep as `gradation` in front of a flat wall of size `h_min`,
/// less than `h_max`.
double reaction_for(double h_min, double h_max, double gradation);

/// The paper's multigrid mode: the steady state, on a coarse uniform mesh of the domain.
///
/// Its edges are 2.5 times the least size, or longer where that would be more than a million tets.
/// \throws Error{Cancelled}
std::shared_ptr<const SizingSource> spread_on_coarse_mesh(const MapToSpread& map,
                                                          const Domain& domain, RunContext& run);

/// The paper's coupled mode: a map that diffuses on the particles while they relax.
///
/// Before its first step it is `start`, and it is never above that. Not to be asked while it steps.
class CoupledSizing final : public SizingField {
public:
    /// \param start  minimum of everything that asks for a size
    CoupledSizing(LipschitzField start, MapToSpread map);

    [[nodiscard]] double h(const Vec3& point) const override { return least_within(point, 0.0); }
    [[nodiscard]] double least_within(const Vec3& center, double radius) const override;
    [[nodiscard]] double h_min() const override { return start_.h_min(); }
    [[nodiscard]] double h_max() const override { return start_.h_max(); }
    [[nodiscard]] double gradation() const override { return start_.gradation(); }

    /// An implicit Euler step of 1 / -R on the particles' Delaunay tets; their h follows.
    /// \param particles  those of the step before, repopulated
    /// \throws Error{Cancelled}
    void diffuse(Particles& particles, const TetComplex& delaunay, const Domain& domain,
                 const RunContext& run);
    /// Takes c along to new particles.
    /// \param origin  of each particle: itself before, twice, or the ends of the edge it came into
    void repopulate(const std::vector<std::array<Index, 2>>& origin);

private:
    LipschitzField start_;
    MapToSpread map_;
    std::vector<double> c_{};  // Of the particles; not limited by the gradation.
    std::shared_ptr<const SizingSource> spread_{};
};

}  // namespace remesh
