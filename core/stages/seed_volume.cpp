#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/geometry/dart_grid.h"
#include "core/parallel.h"
#include "core/stages/seed.h"
#include "core/stages/seed_lattice.h"

namespace remesh {
namespace {

// The lattice of the largest h reaches down to this share of it; from there bands of h, each
// sqrt(2) wide, have lattices of their own.
constexpr double kPlateau = 0.9;
constexpr double kBandWidth = 1.4142135623730951;
constexpr double kBandRadius = 0.7;   // Sites of a band keep this far over h from other points.
constexpr double kGradedWall = 0.55;  // Over h: distance from the boundary where h varies.
constexpr double kDartRadius = 0.8;   // Between the bands darts fill the gaps,
constexpr int kDartLevels = 3;        // in cells of h and two halvings.

// Fills the parts of a body where h varies. What hits points of an earlier round is sorted out side
// by side; what is left goes one by one, since each point depends on those before it.
class GradedFill {
public:
    GradedFill(const Domain& domain, const SizingField& sizing, const SeedOptions& options,
               std::optional<double> shell, Particles& particles)
        : box_(domain.bounds()),
          sizing_(sizing),
          options_(options),
          shell_(shell),
          particles_(particles),
          grid_(box_.low, sizing.h_min(), sizing.h_max(), kDartRadius) {
        for (std::size_t i = 0; i < particles.size(); ++i) {
            if (particles.kind[i] == ParticleKind::Volume) {
                grid_.add(particles.position[i], particles.h[i]);
            }
        }
    }

    void add_band(const LatticeFill& lattice, RunContext& run) {
        std::vector<Dart> sites;
        lattice.visit(particles_.size(), [&](const Vec3& x, double h) { sites.push_back({x, h}); });
        std::vector<char> is_free(sites.size(), 0);
        for_each_index(sites.size(), run, [&](std::size_t i) {
            is_free[i] = !is_taken(sites[i].x, sites[i].h, kBandRadius);
        });
        for (std::size_t i = 0; i < sites.size(); ++i) {
            if (i % kGrain == 0) {
                check_particles(run);
            }
            if (is_free[i] != 0 && !is_taken(sites[i].x, sites[i].h, kBandRadius)) {
                add(sites[i].x, sites[i].h);
            }
        }
    }

    // Throws a dart into every cell of about one h, cuts the cells, drops the parts that a point
    // covers, and so on: few darts leave no room for another point.
    void throw_darts(const LatticeFill& lattice, RunContext& run) {
        std::vector<Cell> cells = find_cells(lattice, run);
        for (int level = 0; level < kDartLevels; ++level) {
            std::vector<std::vector<Dart>> blocks((cells.size() + kGrain - 1) / kGrain);
            for_each_block(cells.size(), kGrain, run, [&](std::size_t begin, std::size_t end) {
                for (std::size_t c = begin; c < end; ++c) {
                    if (const auto dart = throw_dart(cells[c], c, level, lattice)) {
                        blocks[begin / kGrain].push_back(*dart);
                    }
                }
            });
            for (const auto& block : blocks) {
                check_particles(run);
                for (const Dart& dart : block) {
                    if (!is_taken(dart.x, dart.h, kDartRadius)) {
                        add(dart.x, dart.h);
                    }
                }
            }
            if (level + 1 < kDartLevels) {
                cells = uncovered_parts(cells, lattice, run);
            }
        }
    }

private:
    struct Cell {
        Vec3 middle;
        double size;
        double least_h;  // Lower bound of h in it.
        LatticeFill::Place known;
    };

    struct Dart {
        Vec3 x;
        double h;
    };

    void check_particles(const RunContext& run) const {
        run.checkpoint();
        if (particles_.size() > static_cast<std::size_t>(options_.max_particles)) {
            throw Error(ErrorCode::TooLarge,
                        "the sizes ask for more particles than seed.max_particles = " +
                            std::to_string(options_.max_particles) + "; use larger ones");
        }
    }

    [[nodiscard]] bool is_taken(const Vec3& x, double h, double radius) const {
        return grid_.has_conflict(x, h, [radius](Index, double squared, double mean_h) {
            return squared < radius * radius * mean_h * mean_h;
        });
    }

    // Whether one point takes the whole cell.
    [[nodiscard]] bool is_covered(const Cell& cell) const {
        const double radius = kHalfDiagonal * cell.size;
        return grid_.has_conflict(cell.middle, cell.least_h,
                                  [radius](Index, double squared, double mean_h) {
                                      const double reach = kDartRadius * mean_h - radius;
                                      return reach > 0.0 && squared < reach * reach;
                                  });
    }

    void add(const Vec3& x, double h) {
        particles_.add(x, ParticleKind::Volume, kNone, h, Vec3::Zero());
        grid_.add(x, h);
    }

    static Cell part_of(const Cell& cell, std::size_t k) {
        const Vec3 corner(k & 1U ? 0.25 : -0.25, k & 2U ? 0.25 : -0.25, k & 4U ? 0.25 : -0.25);
        return {cell.middle + cell.size * corner, 0.5 * cell.size, cell.least_h, cell.known};
    }

    // No dart in the cell can stay.
    [[nodiscard]] bool is_lost(const Cell& cell) const {
        const double reach = (cell.middle - cell.known.x).norm() + kHalfDiagonal * cell.size;
        const double depth = cell.known.is_inside ? cell.known.distance : -cell.known.distance;
        return depth + reach < kGradedWall * cell.least_h ||
               (shell_ && depth - reach > *shell_ * sizing_.h_max()) ||
               cell.least_h >= kPlateau * sizing_.h_max();
    }

    // The whole cell is inside and far enough from the wall.
    [[nodiscard]] bool is_clear(const Cell& cell) const {
        const double offset = (cell.middle - cell.known.x).norm() + kHalfDiagonal * cell.size;
        return cell.known.is_inside && cell.known.distance - offset > kGradedWall * cell.least_h;
    }

    // Cells no larger than h that cover the part of the body where h is below its plateau.
    [[nodiscard]] std::vector<Cell> find_cells(const LatticeFill& lattice, RunContext& run) const {
        const double size = (box_.high - box_.low).maxCoeff();
        const Vec3 middle = 0.5 * (box_.low + box_.high);
        std::vector<Cell> level{{middle, size, sizing_.h_min(), lattice.look_at(middle, nullptr)}};
        std::vector<Cell> found;
        while (!level.empty()) {
            std::vector<Cell> parts(8 * level.size());
            std::vector<char> is_fine(parts.size(), 0);
            for_each_index(parts.size(), run, [&](std::size_t k) {
                const Cell& parent = level[k / 8];
                Cell& part = parts[k] = part_of(parent, k % 8);
                part.least_h = sizing_.least_within(part.middle, kHalfDiagonal * part.size);
                if (part.least_h < kPlateau * sizing_.h_max()) {
                    part.known = lattice.look_at(part.middle, &parent.known);
                    is_fine[k] = part.size <= sizing_.h(part.middle);
                }
            });
            level.clear();
            for (std::size_t k = 0; k < parts.size(); ++k) {
                if (!is_lost(parts[k])) {
                    (is_fine[k] != 0 ? found : level).push_back(parts[k]);
                }
            }
            check_count(found.size() + level.size());
        }
        return found;
    }

    // A cell holds a fifth of a particle or more.
    void check_count(std::size_t cells) const {
        if (static_cast<double>(cells) > 8.0 * static_cast<double>(options_.max_particles)) {
            throw Error(ErrorCode::TooLarge,
                        "the sizes ask for more particles than seed.max_particles = " +
                            std::to_string(options_.max_particles) + "; use larger ones");
        }
    }

    [[nodiscard]] std::vector<Cell> uncovered_parts(const std::vector<Cell>& cells,
                                                    const LatticeFill& lattice,
                                                    RunContext& run) const {
        std::vector<std::vector<Cell>> blocks((cells.size() + kGrain - 1) / kGrain);
        for_each_block(cells.size(), kGrain, run, [&](std::size_t begin, std::size_t end) {
            for (std::size_t c = begin; c < end; ++c) {
                for (std::size_t k = 0; k < 8; ++k) {
                    Cell part = part_of(cells[c], k);
                    if (is_covered(part) || is_lost(part)) {
                        continue;
                    }
                    if (!is_clear(part)) {
                        part.known = lattice.look_at(part.middle, &part.known);
                    }
                    if (!is_lost(part)) {
                        blocks[begin / kGrain].push_back(part);
                    }
                }
            }
        });
        std::vector<Cell> parts;
        for (const auto& block : blocks) {
            parts.insert(parts.end(), block.begin(), block.end());
        }
        return parts;
    }

    // A dart that keeps its distance from the points so far.
    [[nodiscard]] std::optional<Dart> throw_dart(const Cell& cell, std::size_t index, int level,
                                                 const LatticeFill& lattice) const {
        const auto random = [&](unsigned axis) {
            return hash_random(options_.seed ^ 0xda27, index,
                               4 * static_cast<std::uint64_t>(level) + axis) -
                   0.5;
        };
        const Vec3 x = cell.middle + cell.size * Vec3(random(0), random(1), random(2));
        // What is taken for the least h is taken for h: most darts end here.
        if (is_taken(x, cell.least_h, kDartRadius)) {
            return {};
        }
        const double h = sizing_.h(x);
        if (h < kPlateau * sizing_.h_max() && !is_taken(x, h, kDartRadius) &&
            lattice.is_free(cell.known, x, h, kGradedWall)) {
            return Dart{x, h};
        }
        return {};
    }

    Box box_;
    const SizingField& sizing_;
    const SeedOptions& options_;
    std::optional<double> shell_;
    Particles& particles_;
    DartGrid grid_;
};

}  // namespace

Particles seed_volume(const Particles& surface, const Domain& domain, const SizingField& sizing,
                      std::optional<double> shell, const SeedOptions& options, RunContext& run) {
    validate(options);
    const double plateau = kPlateau * sizing.h_max();
    LatticeFill coarsest(domain, sizing,
                         {.low = plateau, .spacing = sizing.h_max(), .wall = options.wall_distance},
                         shell, options);
    coarsest.classify(run);
    run.report(0.5);
    Particles particles = surface;
    particles.lattice = coarsest.lattice();
    coarsest.visit(particles.size(), [&](const Vec3& x, double h) {
        particles.add(x, ParticleKind::Volume, kNone, h, Vec3::Zero());
    });
    if (!sizing.is_uniform()) {
        GradedFill graded(domain, sizing, options, shell, particles);
        for (double high = plateau; high > sizing.h_min(); high /= kBandWidth) {
            const double low = high / kBandWidth;
            LatticeFill band(
                domain, sizing,
                {.low = low, .high = high, .spacing = std::sqrt(low * high), .wall = kGradedWall},
                shell, options);
            band.classify(run);
            graded.add_band(band, run);
        }
        run.report(0.8);
        graded.throw_darts(coarsest, run);
    }
    run.report(1.0);
    return particles;
}

}  // namespace remesh
