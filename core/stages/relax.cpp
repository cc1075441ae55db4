#include "core/stages/relax.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/geometry/curve_track.h"
#include "core/mesh/index.h"
#include "core/number_text.h"
#include "core/stages/relax_dynamics.h"

namespace remesh {
namespace {

constexpr double kCurveCutoff = 2.0;          // rc over h: reaches the next particle only.
constexpr double kSurfaceCutoff = 1.33;       // Beyond the first ring of neighbours.
constexpr double kVolumeCutoff = 1.14;        // Between the shells; from 1.3 on the lattice melts.
constexpr double kGradedVolumeCutoff = 1.09;  // Where h varies there is no lattice to keep.
constexpr int kVolumeIterations = 25;
constexpr double kPlateau = 0.97;      // Of the largest h: what has more is on its lattice.
constexpr double kSlide = 0.05;        // Slides this far over h before it is snapped.
constexpr double kTooClose = 0.4;      // Surface particles closer than this times h merge.
constexpr double kWall = 0.4;          // Volume particles stay this far over h inside.
constexpr double kSurfaceShare = 0.7;  // Of the stage's progress.

bool are_opposed(const Particles& particles, std::size_t i, std::size_t j) {
    return particles.kind[i] == ParticleKind::Surface &&
           particles.kind[j] == ParticleKind::Surface &&
           particles.normal[i].dot(particles.normal[j]) < kOpposed;
}

std::vector<Index> of_kind(const Particles& particles, ParticleKind low, ParticleKind high) {
    std::vector<Index> found;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (particles.kind[i] >= low && particles.kind[i] <= high) {
            found.push_back(static_cast<Index>(i));
        }
    }
    return found;
}

// Curve particles know their arc length, so they can't leave their curve.
class CurveBond {
public:
    CurveBond(Particles& particles, const std::vector<Index>& moving, const FeatureSet& features)
        : particles_(particles), moving_(moving) {
        for (const FeatureCurve& curve : features.curves) {
            tracks_.emplace_back(curve.points, curve.is_closed);
        }
        for (const Index i : moving_) {
            arc_.push_back(track(i).arc_of(particles_.position[at(i)]));
        }
    }

    [[nodiscard]] Vec3 constrain(std::size_t k, const Vec3& force) const {
        const Vec3& tangent = particles_.normal[at(moving_[k])];
        return tangent * tangent.dot(force);
    }
    [[nodiscard]] double max_step(std::size_t) const {
        return std::numeric_limits<double>::infinity();
    }
    void moved(std::size_t k, const Vec3& step) {
        const std::size_t i = at(moving_[k]);
        arc_[k] += step.dot(particles_.normal[i]);
        const CurveTrack::Place place = track(moving_[k]).at(arc_[k]);
        particles_.position[i] = place.point;
        particles_.normal[i] = place.tangent;
    }
    [[nodiscard]] bool are_neighbours(Index i, Index j) const {
        return particles_.kind[at(j)] == ParticleKind::Corner ||
               particles_.anchor[at(i)] == particles_.anchor[at(j)];
    }
    [[nodiscard]] std::int64_t surface_particles() const {
        return static_cast<std::int64_t>(particles_.size());
    }
    void save(StateWriter& to) const { to.put(arc_); }
    void restore(StateReader& from) { from.get_as_many(arc_); }

private:
    [[nodiscard]] const CurveTrack& track(Index i) const {
        return tracks_[at(particles_.anchor[at(i)])];
    }

    Particles& particles_;
    const std::vector<Index>& moving_;
    std::vector<CurveTrack> tracks_{};
    std::vector<double> arc_{};
};

// Surface particles slide in their tangent plane and are snapped to the boundary as soon as the
// curvature could matter: a slide of 0.05 h is off by 0.0006 h where the radius is 2 h.
class SurfaceBond {
public:
    SurfaceBond(Particles& particles, const std::vector<Index>& moving, const Domain& domain)
        : particles_(particles), moving_(moving), domain_(domain), slid_(moving.size(), 0.0) {}

    [[nodiscard]] Vec3 constrain(std::size_t k, const Vec3& force) const {
        const Vec3& normal = particles_.normal[at(moving_[k])];
        return force - normal * normal.dot(force);
    }
    [[nodiscard]] double max_step(std::size_t) const {
        return std::numeric_limits<double>::infinity();
    }
    void moved(std::size_t k, const Vec3& step) {
        const std::size_t i = at(moving_[k]);
        particles_.position[i] += step;
        slid_[k] += step.norm();
        if (slid_[k] > kSlide * particles_.h[i]) {
            snap(k);
        }
    }
    void snap(std::size_t k) {
        const std::size_t i = at(moving_[k]);
        const BoundaryPoint on = domain_.closest(particles_.position[i], particles_.anchor[i]);
        particles_.position[i] = on.point;
        particles_.normal[i] = on.normal;
        particles_.anchor[i] = on.facet;
        slid_[k] = 0.0;
    }
    [[nodiscard]] bool are_neighbours(Index i, Index j) const {
        return !are_opposed(particles_, at(i), at(j));
    }
    [[nodiscard]] std::int64_t surface_particles() const {
        return static_cast<std::int64_t>(particles_.size());
    }
    void save(StateWriter& to) const { to.put(slid_); }
    void restore(StateReader& from) { from.get_as_many(slid_); }

private:
    Particles& particles_;
    const std::vector<Index>& moving_;
    const Domain& domain_;
    std::vector<double> slid_;  // Path since the last snap.
};

// Volume particles stay inside. Each keeps a lower bound of its distance to the boundary and asks
// again only when its moves have used that up; no step is longer than half of it, so that a
// particle can never pass through a wall, however thin the body.
class WallBond {
public:
    WallBond(Particles& particles, const std::vector<Index>& moving, const Domain& domain,
             std::vector<double> clearance, std::vector<Index> facet,
             std::int64_t surface_particles)
        : particles_(particles),
          moving_(moving),
          domain_(domain),
          clearance_(std::move(clearance)),
          facet_(std::move(facet)),
          surface_particles_(surface_particles) {}

    [[nodiscard]] Vec3 constrain(std::size_t, const Vec3& force) const { return force; }
    [[nodiscard]] double max_step(std::size_t k) const { return 0.5 * clearance_[k]; }
    void moved(std::size_t k, const Vec3& step) {
        const std::size_t i = at(moving_[k]);
        const double wall = kWall * particles_.h[i];
        Vec3& x = particles_.position[i];
        x += step;
        clearance_[k] -= step.norm();
        if (clearance_[k] >= wall) {
            return;
        }
        const BoundaryPoint near = domain_.closest(x, facet_[k]);
        facet_[k] = near.facet;
        clearance_[k] = near.distance;
        if (near.distance < wall && near.distance > 0.0) {
            // Away from the wall, but never so far that another wall could be crossed.
            const double push = std::min(wall - near.distance, 0.4 * near.distance);
            x += (x - near.point) * (push / near.distance);
            clearance_[k] -= push;
        }
    }
    [[nodiscard]] bool are_neighbours(Index, Index) const { return true; }
    [[nodiscard]] std::int64_t surface_particles() const { return surface_particles_; }
    void save(StateWriter& to) const {
        to.put(clearance_);
        to.put(facet_);
    }
    void restore(StateReader& from) {
        from.get_as_many(clearance_);
        from.get_as_many(facet_);
    }

private:
    Particles& particles_;
    const std::vector<Index>& moving_;
    const Domain& domain_;
    std::vector<double> clearance_;
    std::vector<Index> facet_;
    std::int64_t surface_particles_;
};

// Drops surface particles that ended too close to an earlier particle of the same sheet.
Particles without_crowded(const Particles& particles) {
    const std::vector<Index> all = of_kind(particles, ParticleKind::Surface, ParticleKind::Corner);
    const NeighbourGrid grid(particles.position, particles.h, all, kTooClose);
    std::vector<char> keep(particles.size(), 1);
    Particles kept;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (particles.kind[i] == ParticleKind::Surface) {
            grid.visit(particles.position[i], particles.h[i], [&](Index j, double) {
                if (at(j) < i && keep[at(j)] && !are_opposed(particles, i, at(j))) {
                    keep[i] = 0;
                }
            });
        }
        if (keep[i]) {
            kept.add(particles.position[i], particles.kind[i], particles.anchor[i], particles.h[i],
                     particles.normal[i]);
        }
    }
    return kept;
}

void update_h(Particles& particles, const std::vector<Index>& moving, const SizingField& sizing,
              const RunContext& run) {
    if (sizing.is_uniform()) {
        return;
    }
    for_each_index(moving.size(), run, [&](std::size_t k) {
        particles.h[at(moving[k])] = sizing.h(particles.position[at(moving[k])]);
    });
}

void check_positions(const Particles& particles) {
    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (!particles.position[i].allFinite() || !(particles.h[i] > 0.0)) {
            throw Error(ErrorCode::InvalidInput,
                        "particle " + std::to_string(i) + " has no finite position or h > 0");
        }
    }
}

}  // namespace

void validate(const RelaxOptions& options) {
    const auto check = [](const char* field, double value, bool is_good, const char* range) {
        if (!is_good) {
            throw Error(ErrorCode::InvalidInput, std::string("relax.") + field + " must be " +
                                                     range + ", got " + number_text(value));
        }
    };
    const auto is_positive = [](double value) { return std::isfinite(value) && value > 0.0; };
    check("mass", options.mass, is_positive(options.mass), "> 0 and finite");
    check("damping", options.damping, options.damping > 0.0 && options.damping <= 2.0, "in (0, 2]");
    check("charge_exponent", options.charge_exponent,
          options.charge_exponent >= 1.0 && options.charge_exponent <= 6.0, "in [1, 6]");
    check("max_surface_iterations", options.max_surface_iterations,
          options.max_surface_iterations >= 0, ">= 0");
    const int volume_iterations = options.max_volume_iterations.value_or(0);
    check("max_volume_iterations", volume_iterations, volume_iterations >= 0, ">= 0");
    check("tolerance", options.tolerance, is_positive(options.tolerance), "> 0 and finite");
    check("active_depth", options.active_depth, is_positive(options.active_depth),
          "> 0 and finite");
}

RelaxResult relax_surface(const Particles& particles, const Domain& domain,
                          const FeatureSet& features, const SizingField& sizing,
                          const RelaxOptions& options, RunContext& run) {
    validate(options);
    check_positions(particles);
    Particles moved = particles;
    PairForce pair{.law = options.force,
                   .cutoff = kCurveCutoff,
                   .exponent = options.charge_exponent,
                   .dimension = 1};

    const std::vector<Index> bound = of_kind(moved, ParticleKind::Curve, ParticleKind::Corner);
    const std::vector<Index> curve = of_kind(moved, ParticleKind::Curve, ParticleKind::Curve);
    CurveBond on_curves(moved, curve, features);
    Swarm curves(moved, curve, bound, sizing, options, pair, on_curves);
    curves.relax(options.max_surface_iterations, 0.0, 0.05 * kSurfaceShare, run);
    update_h(moved, curve, sizing, run);

    const std::vector<Index> all = of_kind(moved, ParticleKind::Surface, ParticleKind::Corner);
    const std::vector<Index> sliding = of_kind(moved, ParticleKind::Surface, ParticleKind::Surface);
    SurfaceBond on_surface(moved, sliding, domain);
    pair.cutoff = kSurfaceCutoff;
    pair.dimension = 2;
    Swarm surface(moved, sliding, all, sizing, options, pair, on_surface);
    const SwarmState state =
        surface.relax(options.max_surface_iterations, 0.05 * kSurfaceShare, kSurfaceShare, run);
    for_each_index(sliding.size(), run, [&](std::size_t k) { on_surface.snap(k); });
    update_h(moved, sliding, sizing, run);
    return {.particles = without_crowded(moved),
            .iterations = state.iterations,
            .residual = state.residual,
            .converged = state.converged};
}

RelaxResult relax_volume(const Particles& particles, const Domain& domain,
                         const SizingField& sizing, const RelaxOptions& options, RunContext& run) {
    validate(options);
    check_positions(particles);
    Particles moved = particles;
    const PairForce pair{.law = options.force,
                         .cutoff = sizing.is_uniform() ? kVolumeCutoff : kGradedVolumeCutoff,
                         .exponent = options.charge_exponent,
                         .dimension = 3};

    const std::vector<Index> boundary = of_kind(moved, ParticleKind::Surface, ParticleKind::Corner);
    const std::vector<Index> volume = of_kind(moved, ParticleKind::Volume, ParticleKind::Volume);

    // Boundary particles are about h apart: whatever is within `depth` of the boundary is within
    // depth + h of one of them, and its facet is a good guess for the closest one.
    const double depth = options.active_depth;
    const double margin = 1.0;
    const double reach = depth + pair.cutoff + 2.0 * margin;
    const NeighbourGrid skin(moved.position, moved.h, boundary, reach);
    std::vector<Index> guess(volume.size(), kNone);
    std::vector<double> distance(volume.size(), std::numeric_limits<double>::infinity());
    std::vector<char> is_near(volume.size(), 0);
    for_each_index(volume.size(), run, [&](std::size_t k) {
        const std::size_t i = at(volume[k]);
        double best = std::numeric_limits<double>::infinity();
        Index nearest = kNone;
        skin.visit(moved.position[i], moved.h[i], [&](Index j, double squared) {
            if (squared < best) {
                best = squared;
                nearest = j;
            }
        });
        is_near[k] = nearest != kNone;
        if (nearest == kNone || best > std::pow((depth + margin) * moved.h[i], 2)) {
            return;
        }
        const bool has_facet = moved.kind[at(nearest)] == ParticleKind::Surface;
        const BoundaryPoint on =
            domain.closest(moved.position[i], has_facet ? moved.anchor[at(nearest)] : kNone);
        guess[k] = on.facet;
        distance[k] = on.distance;
    });

    std::vector<Index> moving;
    std::vector<Index> present = boundary;
    std::vector<double> clearance;
    std::vector<Index> facet;
    for (std::size_t k = 0; k < volume.size(); ++k) {
        const double h = moved.h[at(volume[k])];
        // Where h varies there is no equilibrium to start from, however deep.
        const bool is_graded = h < kPlateau * sizing.h_max();
        if (is_near[k] || !sizing.is_uniform()) {
            present.push_back(volume[k]);
        }
        if (distance[k] < depth * h || is_graded) {
            moving.push_back(volume[k]);
            clearance.push_back(std::min(distance[k], depth * h));
            facet.push_back(guess[k]);
        }
    }
    WallBond inside(moved, moving, domain, std::move(clearance), std::move(facet),
                    static_cast<std::int64_t>(boundary.size()));
    Swarm swarm(moved, moving, present, sizing, options, pair, inside);
    const SwarmState state = swarm.relax(options.max_volume_iterations.value_or(kVolumeIterations),
                                         kSurfaceShare, 1.0, run);
    update_h(moved, moving, sizing, run);
    return {.particles = std::move(moved),
            .iterations = state.iterations,
            .residual = state.residual,
            .converged = state.converged};
}

}  // namespace remesh
