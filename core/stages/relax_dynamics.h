#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/geometry/neighbour_grid.h"
#include "core/geometry/particles.h"
#include "core/geometry/sizing_field.h"
#include "core/parallel.h"
#include "core/run_context.h"
#include "core/run_state.h"
#include "core/stages/relax.h"

namespace remesh {

/// Force between two particles at distance s = r / h_ij: pushes only, and vanishes at the cut-off.
struct PairForce {
    ForceLaw law = ForceLaw::Springs;
    double cutoff = 1.0;    ///< rc, over h_ij.
    double exponent = 2.0;  ///< p of the power law.
    int dimension = 3;  ///< Of what the particles fill. Forces are scaled by h_ij^(dimension - 1),
                        ///< or particles would drift from where h is small to where it is large.
};

/// Force, stiffness -df/ds and energy of a pair.
struct PairState {
    double force;
    double stiffness;
    double energy;
};

template <ForceLaw kLaw>
[[nodiscard]] PairState pair_state(const PairForce& pair, double s) {
    if constexpr (kLaw == ForceLaw::Springs) {
        const double t = 1.0 - s / pair.cutoff;
        if (pair.dimension == 2) {
            return {t * t, 2.0 * t / pair.cutoff, pair.cutoff * t * t * t / 3.0};
        }
        return {t, 1.0 / pair.cutoff, 0.5 * pair.cutoff * t * t};
    } else {
        const double p = pair.exponent;
        const double near = std::pow(s, -p);
        const double far = std::pow(pair.cutoff, -p);
        const bool is_log = std::abs(p - 1.0) < 1e-9;
        const double energy =
            is_log ? std::log(pair.cutoff / s) : (near * s - far * pair.cutoff) / (p - 1.0);
        return {near - far, p * near / s, energy - far * (pair.cutoff - s)};
    }
}

/// What a swarm of particles looked like at the end of a step.
struct SwarmState {
    int iterations = 0;
    double residual = 0.0;  ///< rms step to equilibrium over h.
    bool converged = false;
    bool is_over = false;  ///< Nothing more to do.
};

/// Integrates M r'' + D r' = F over the particles that move, while all others stand still.
///
/// Each particle gathers its own force from its list of neighbours, scaled by its own stiffness:
/// `pull` is the step that would bring it to rest if its neighbours stood still. Time is counted in
/// steps, mass in units of stiffness times step squared.
///
/// A `Bond` says what a particle is bound to:
///   Vec3 constrain(std::size_t k, const Vec3& force)   part of the force that it can follow
///   double max_step(std::size_t k)                     longest step that is safe, model units
///   void moved(std::size_t k, const Vec3& step)        puts the particle where the step leads
///   bool are_neighbours(Index i, Index j)
///   void save(StateWriter&), void restore(StateReader&)   what it knows of the particles that move
template <typename Bond>
class Swarm {
public:
    Swarm(Particles& particles, std::vector<Index> moving, const std::vector<Index>& present,
          const SizingField& sizing, const RelaxOptions& options, PairForce pair, Bond& bond)
        : particles_(particles),
          moving_(std::move(moving)),
          present_(present),
          sizing_(sizing),
          options_(options),
          pair_(pair),
          bond_(bond),
          pull_(moving_.size(), Vec3::Zero()),
          velocity_(moving_.size(), Vec3::Zero()),
          energy_(moving_.size(), 0.0),
          speed_(moving_.size(), 0.0) {}

    /// Steps until the residual is below the tolerance, or `max_iterations` times; goes on where an
    /// earlier run was, if `run` knows of one. Reports progress from `from` to `to`.
    SwarmState relax(int max_iterations, double from, double to, RunContext& run) {
        first_sample_ = run.samples().size();
        SwarmState state;
        if (run.state() != nullptr) {
            restore(state, run);
        }
        try {
            while (!state.is_over && state.iterations < max_iterations && !moving_.empty()) {
                iterate(state, run);
                run.report(from + (to - from) * state.iterations / max_iterations);
            }
        } catch (const Error&) {
            if (run.state() != nullptr) {
                run.state()->keep(record(state, run));
            }
            throw;
        }
        state.is_over = true;
        state.converged = state.converged || moving_.empty();
        if (run.state() != nullptr) {
            lists_ = {};
            listed_.clear();
            velocity_.clear();
            run.state()->finish(record(state, run));
        }
        run.report(to);
        return state;
    }

private:
    static constexpr double kSkin = 0.35;     // Of neighbour lists, over h.
    static constexpr double kMaxStep = 0.15;  // Of one iteration, over h.
    static constexpr int kCalm = 10;          // Iterations after which steps get shorter.
    static constexpr std::size_t kMaxPictured = 20'000;

    static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
    [[nodiscard]] std::size_t row(std::size_t k) const { return at(moving_[k]); }

    [[nodiscard]] bool needs_lists() const {
        const double farthest = max_over(moving_.size(), 0.0, [&](std::size_t k) {
            const double h = particles_.h[row(k)];
            return (particles_.position[row(k)] - listed_[k]).squaredNorm() / (h * h);
        });
        // A pair could approach by twice this, but hardly any does, and forces vanish at the
        // cut-off.
        return farthest > kSkin * kSkin;
    }

    // Whenever it throws, `state` and the particles are those at the end of an iteration.
    void iterate(SwarmState& state, RunContext& run) {
        if (lists_.start.empty() || needs_lists()) {
            lists_ = {};
            list(run);
        }
        gather(run);
        state.residual = residual();
        if (state.residual < options_.tolerance) {
            state.is_over = state.converged = true;
            return;
        }
        step(state.iterations);
        ++state.iterations;
        send_sample(state.residual, run);
        if (run.state() != nullptr && run.state()->is_due()) {
            run.state()->keep(record(state, run));
            run.state()->save();
        }
        if (run.wants_preview()) {
            run.preview(picture());
        }
    }

    /// All that the next iterations depend on, and what is told of those before.
    [[nodiscard]] std::string record(const SwarmState& state, const RunContext& run) const {
        StateWriter to;
        to.put(state);
        to.put(fire_);
        to.put(time_);
        to.put(std::vector(run.samples().begin() + static_cast<std::ptrdiff_t>(first_sample_),
                           run.samples().end()));
        Particles moving;
        for (const Index i : moving_) {
            moving.add(particles_.position[at(i)], particles_.kind[at(i)], particles_.anchor[at(i)],
                       particles_.h[at(i)], particles_.normal[at(i)]);
        }
        to.put(moving.position);
        to.put(moving.anchor);
        to.put(moving.h);
        to.put(moving.normal);
        to.put(velocity_);
        to.put(lists_.start);
        to.put(lists_.index);
        to.put(listed_);
        bond_.save(to);
        return to.take();
    }

    void restore(SwarmState& state, RunContext& run) {
        const std::string_view saved = run.state()->begin();
        if (saved.empty()) {
            return;
        }
        StateReader from(saved);
        from.get(state);
        from.get(fire_);
        from.get(time_);
        std::vector<ConvergenceSample> samples;
        from.get(samples);
        run.resume(samples);
        Particles moving;
        moving.position.resize(moving_.size());
        moving.anchor.resize(moving_.size());
        moving.h.resize(moving_.size());
        moving.normal.resize(moving_.size());
        from.get_as_many(moving.position);
        from.get_as_many(moving.anchor);
        from.get_as_many(moving.h);
        from.get_as_many(moving.normal);
        for (std::size_t k = 0; k < moving_.size(); ++k) {
            particles_.position[row(k)] = moving.position[k];
            particles_.anchor[row(k)] = moving.anchor[k];
            particles_.h[row(k)] = moving.h[k];
            particles_.normal[row(k)] = moving.normal[k];
        }
        from.get(velocity_);
        from.get(lists_.start);
        from.get(lists_.index);
        from.get(listed_);
        bond_.restore(from);
        if (!from.is_at_end() || (!state.is_over && velocity_.size() != moving_.size())) {
            throw StaleState();
        }
    }

    void list(const RunContext& run) {
        listed_.resize(moving_.size());
        for_each_index(moving_.size(), run, [&](std::size_t k) {
            listed_[k] = particles_.position[row(k)];
            if (!sizing_.is_uniform()) {
                particles_.h[row(k)] = sizing_.h(particles_.position[row(k)]);
            }
        });
        const NeighbourGrid grid(particles_.position, particles_.h, present_, pair_.cutoff + kSkin);
        lists_ = list_neighbours(grid, particles_.position, particles_.h, moving_, run,
                                 [&](Index i, Index j) { return bond_.are_neighbours(i, j); });
    }

    void gather(const RunContext& run) {
        if (pair_.law == ForceLaw::Springs) {
            gather_by<ForceLaw::Springs>(run);
        } else {
            gather_by<ForceLaw::ChargedParticles>(run);
        }
    }

    template <ForceLaw kLaw>
    void gather_by(const RunContext& run) {
        const bool is_uniform = sizing_.is_uniform();
        for_each_index(moving_.size(), run, [&](std::size_t k) {
            const Vec3 x = particles_.position[row(k)];
            const double h = particles_.h[row(k)];
            Vec3 force = Vec3::Zero();
            double stiffness = 0.0;
            double energy = 0.0;
            for (std::size_t q = lists_.start[k]; q < lists_.start[k + 1]; ++q) {
                const std::size_t j = at(lists_.index[q]);
                const Vec3 apart = x - particles_.position[j];
                const double squared = apart.squaredNorm();
                const double mean_h = is_uniform ? h : 0.5 * (h + particles_.h[j]);
                const double reach = pair_.cutoff * mean_h;
                if (squared >= reach * reach || squared <= 0.0) {
                    continue;
                }
                const double r = std::sqrt(squared);
                const double s = r / mean_h;
                const PairState state = pair_state<kLaw>(pair_, s);
                double weight = 1.0;
                for (int power = 1; power < pair_.dimension && !is_uniform; ++power) {
                    weight *= mean_h / h;
                }
                force += (weight * state.force / r) * apart;
                // Mean over the directions: along the pair k, across it f / s.
                stiffness += weight * (state.stiffness + 2.0 * state.force / s) / 3.0;
                energy += 0.5 * weight * state.energy;
            }
            pull_[k] = stiffness > 0.0 ? Vec3((h / stiffness) * bond_.constrain(k, force))
                                       : Vec3(Vec3::Zero());
            energy_[k] = energy;
        });
    }

    [[nodiscard]] double residual() const {
        const double sum = sum_over(moving_.size(), [&](std::size_t k) {
            const double h = particles_.h[row(k)];
            return pull_[k].squaredNorm() / (h * h);
        });
        return std::sqrt(sum / static_cast<double>(moving_.size()));
    }

    // What could move for ever, where a body is too thin for its particles, comes to rest, since no
    // step is longer than `cap_`, which falls as 1 / iterations.
    void step(int iterations) {
        cap_ = kMaxStep * std::min(1.0, static_cast<double>(kCalm) / (iterations + 1));
        switch (options_.integrator) {
            case Integrator::DampedDynamics: {
                // Semi-implicit in the damping, so that any damping is stable.
                const double drag = 2.0 * options_.damping / std::sqrt(options_.mass);
                move(1.0, [&](std::size_t k) {
                    return Vec3((velocity_[k] + pull_[k] / options_.mass) / (1.0 + drag));
                });
                break;
            }
            case Integrator::GradientDescent:
                // All at once: half the step that would bring each to rest alone.
                move(1.0, [&](std::size_t k) { return Vec3(0.5 * pull_[k]); });
                break;
            case Integrator::Fire: step_fire(); break;
        }
    }

    // Bitzek et al., Structural Relaxation Made Simple, 2006, with their constants but for the time
    // step, which the scaling by stiffness makes about 1.
    void step_fire() {
        const double power =
            sum_over(moving_.size(), [&](std::size_t k) { return pull_[k].dot(velocity_[k]); });
        double mixing = 0.0;
        if (power > 0.0) {
            const double v =
                sum_over(moving_.size(), [&](std::size_t k) { return velocity_[k].squaredNorm(); });
            const double f =
                sum_over(moving_.size(), [&](std::size_t k) { return pull_[k].squaredNorm(); });
            mixing = fire_.alpha * std::sqrt(v / std::max(f, 1e-300));
            if (++fire_.downhill > 5) {
                fire_.time_step = std::min(1.1 * fire_.time_step, 0.9);
                fire_.next_alpha *= 0.99;
            }
        } else {
            fire_.downhill = 0;
            fire_.time_step = std::max(0.5 * fire_.time_step, 0.1);
            fire_.next_alpha = 0.1;
        }
        const double keep = power > 0.0 ? 1.0 - fire_.alpha : 0.0;
        const double dt = fire_.time_step;
        move(dt,
             [&](std::size_t k) { return Vec3(keep * velocity_[k] + (mixing + dt) * pull_[k]); });
        fire_.alpha = fire_.next_alpha;
    }

    template <typename Velocity>
    void move(double time_step, Velocity velocity) {
        time_ += time_step;
        const RunContext whole;  // Can't be stopped half-way.
        for_each_index(moving_.size(), whole, [&](std::size_t k) {
            velocity_[k] = velocity(k);
            Vec3 step = time_step * velocity_[k];
            const double length = step.norm();
            const double limit = std::min(cap_ * particles_.h[row(k)], bond_.max_step(k));
            if (length > limit) {
                step *= limit / length;
                velocity_[k] = step / time_step;
            }
            speed_[k] = step.norm() / particles_.h[row(k)];
            bond_.moved(k, step);
        });
    }

    void send_sample(double residual, RunContext& run) const {
        const std::size_t n = moving_.size();
        const auto count = static_cast<double>(n);
        const double squared_speed =
            sum_over(n, [&](std::size_t k) { return speed_[k] * speed_[k]; });
        ConvergenceSample sample;
        sample.simulated_time = time_;
        sample.kinetic_energy = 0.5 * options_.mass * squared_speed / count;
        sample.potential_energy = sum_over(n, [&](std::size_t k) { return energy_[k]; }) / count;
        sample.max_displacement = max_over(n, 0.0, [&](std::size_t k) { return speed_[k]; });
        sample.rms_displacement = std::sqrt(squared_speed / count);
        sample.residual_force = residual;
        sample.particles = static_cast<std::int64_t>(particles_.size());
        sample.surface_particles = bond_.surface_particles();
        run.sample(sample);
    }

    /// The particles that move, thinned out evenly if they are many.
    [[nodiscard]] SurfaceMesh picture() const {
        const std::size_t stride = moving_.size() / kMaxPictured + 1;
        SurfaceMesh points;
        for (std::size_t k = 0; k < moving_.size(); k += stride) {
            points.vertices.push_back(particles_.position[row(k)]);
        }
        return points;
    }

    struct Fire {
        double time_step = 0.25;
        double alpha = 0.1;
        double next_alpha = 0.1;
        int downhill = 0;
    };

    Particles& particles_;
    std::vector<Index> moving_;
    const std::vector<Index>& present_;  // All that push: those that move and those that don't.
    const SizingField& sizing_;
    const RelaxOptions& options_;
    PairForce pair_;
    Bond& bond_;
    Points pull_;
    Points velocity_;
    std::vector<double> energy_;
    std::vector<double> speed_;  // Length of the last step over h.
    NeighbourLists lists_{};
    Points listed_{};  // Positions when the lists were made.
    Fire fire_{};
    double time_ = 0.0;
    double cap_ = kMaxStep;         // Of the present step, over h.
    std::size_t first_sample_ = 0;  // Of this relaxation, among the run's.
};

}  // namespace remesh
