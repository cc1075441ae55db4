#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/geometry/dart_grid.h"
#include "core/parallel.h"
#include "core/stages/seed.h"

namespace remesh {
namespace {

constexpr std::size_t kSites = 8;  // Of A15 in a cell.

// The A15 lattice: 8 points a cell, in units of the cell.
const std::array<Vec3, kSites> kLattice{{{0.0, 0.0, 0.0},
                                         {0.5, 0.5, 0.5},
                                         {0.25, 0.5, 0.0},
                                         {0.75, 0.5, 0.0},
                                         {0.0, 0.25, 0.5},
                                         {0.0, 0.75, 0.5},
                                         {0.5, 0.0, 0.25},
                                         {0.5, 0.0, 0.75}}};
constexpr double kCellOverSpacing = 1.833;  // At which A15 is as dense as BCC of that spacing.
constexpr double kHalfDiagonal = 0.8660254037844386;

// Where h is below this share of its maximum the lattice gives way to darts.
constexpr double kPlateau = 0.9;
constexpr double kDartRadius = 0.76;
constexpr int kDartsPerVolume = 40;  // Thrown per h^3.

enum class Side : std::uint8_t { Unknown, Outside, Inside };

// A cube of lattice cells, and what is known about its middle.
struct Block {
    std::array<std::int32_t, 3> cell{};  // Its lowest cell.
    std::int32_t size = 1;               // Cells along an edge: a power of two.
    Index facet = kNone;                 // Of the boundary closest to the middle.
    double distance = 0.0;               // Of the middle from the boundary.
    Side side = Side::Unknown;           // Of the middle.
    bool is_whole = false;               // No boundary or dart region in it: all sites or none.
    std::uint8_t sites = 0;              // Bits of the sites kept, for a single cell.
};

class LatticeFill {
public:
    LatticeFill(const Domain& domain, const SizingField& sizing, std::optional<double> shell,
                const SeedOptions& options)
        : domain_(domain),
          sizing_(sizing),
          shell_(shell),
          options_(options),
          cell_(kCellOverSpacing * options.preload * sizing.h_max()) {
        const Box box = domain.bounds();
        for (Eigen::Index axis = 0; axis < 3; ++axis) {
            const double shift =
                hash_random(options.seed, static_cast<std::uint64_t>(axis), 0x1a77);
            origin_[axis] = box.low[axis] - shift * cell_;
        }
        const double cells = (box.high - origin_).maxCoeff() / cell_ + 1.0;
        while (root_size_ < cells && root_size_ < (1 << 30)) {
            root_size_ *= 2;
        }
    }

    // Refines blocks towards the boundary, level by level. One question for the closest point
    // settles a block that the boundary doesn't reach.
    void classify(RunContext& run) {
        std::vector<Block> level{Block{.size = root_size_}};
        ask(level[0], nullptr);
        while (!level.empty()) {
            std::vector<Block> next;
            std::vector<Block> parents;
            for (const Block& block : level) {
                if (is_empty(block)) {
                    continue;
                }
                if (block.is_whole || block.size == 1) {
                    settled_.push_back(block);
                    count_ += block.is_whole ? kSites * cells_in(block) : 0;
                } else {
                    parents.push_back(block);
                }
            }
            check_count(run, 8.0 * static_cast<double>(parents.size()));
            next.resize(8 * parents.size());
            for_each_index(next.size(), run, [&](std::size_t k) {
                const Block& parent = parents[k / 8];
                Block& child = next[k];
                child.size = parent.size / 2;
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    child.cell[axis] = parent.cell[axis] + ((k >> axis) & 1U ? child.size : 0);
                }
                ask(child, &parent);
            });
            level = std::move(next);
        }
        // Along a Z-order curve: neighbours in space are neighbours in memory.
        Box box{origin_, origin_ + Vec3::Constant(cell_ * root_size_)};
        std::vector<std::pair<std::uint64_t, std::size_t>> order(settled_.size());
        for (std::size_t b = 0; b < order.size(); ++b) {
            order[b] = {morton_code(middle(settled_[b]), box), b};
        }
        std::sort(order.begin(), order.end());
        std::vector<Block> sorted;
        sorted.reserve(settled_.size());
        for (const auto& [code, b] : order) {
            sorted.push_back(settled_[b]);
        }
        settled_ = std::move(sorted);
        for_each_index(settled_.size(), run, [&](std::size_t b) {
            if (!settled_[b].is_whole) {
                choose_sites(settled_[b]);
            }
        });
    }

    // A regular lattice has many nearly cospherical points, for which Delaunay needs exact
    // arithmetic; stirred by a ten-thousandth it takes half the time.
    [[nodiscard]] Vec3 stir(std::size_t particle) const {
        constexpr double kAmount = 1e-4;  // Of a cell.
        const auto random = [&](std::uint64_t draw) {
            return kAmount * (hash_random(options_.seed ^ 0x5715, particle, draw) - 0.5);
        };
        return {random(0), random(1), random(2)};
    }

    void emit(Particles& particles) const {
        for (const Block& block : settled_) {
            emit(block, block.cell, block.size, particles);
        }
    }

    // Fills the regions of varying h that the lattice left free. Serial: a dart depends on those
    // before it.
    void throw_darts(Particles& particles, RunContext& run) const {
        DartGrid grid(origin_, sizing_.h_min(), sizing_.h_max(), kDartRadius);
        for (std::size_t i = 0; i < particles.size(); ++i) {
            if (particles.kind[i] == ParticleKind::Volume) {
                grid.add(particles.position[i], particles.h[i]);
            }
        }
        std::vector<Patch> patches;
        for (const Block& block : settled_) {
            if (!block.is_whole && lowest_h(block) < kPlateau * sizing_.h_max()) {
                split(block, origin_ + cell_ * corner(block), cell_, patches);
            }
        }
        for (int round = 0; round < kDartsPerVolume; ++round) {
            for (std::size_t p = 0; p < patches.size(); ++p) {
                if (p % kGrain == 0) {
                    run.checkpoint();
                }
                if (round < patches[p].darts) {
                    throw_dart(patches[p], p, round, grid, particles);
                }
            }
        }
        check_count(run, static_cast<double>(particles.size()));
    }

private:
    // A cube of about one h in a cell of varying h, and how many darts it gets.
    struct Patch {
        Vec3 low;
        double size;
        int darts;
        const Block* block;
    };

    static Vec3 corner(const Block& block) {
        return Vec3(block.cell[0], block.cell[1], block.cell[2]);
    }
    static double cells_in(const Block& block) { return std::pow(block.size, 3); }
    [[nodiscard]] Vec3 middle(const Block& block) const {
        return origin_ + cell_ * (corner(block) + Vec3::Constant(0.5 * block.size));
    }
    [[nodiscard]] double radius(const Block& block) const {
        return kHalfDiagonal * cell_ * block.size;
    }
    [[nodiscard]] double lowest_h(const Block& block) const {
        return sizing_.is_uniform()
                   ? sizing_.h_max()
                   : sizing_.h(middle(block)) - sizing_.gradation() * radius(block);
    }

    void check_count(RunContext& run, double more) const {
        run.checkpoint();
        if (count_ + more > static_cast<double>(options_.max_particles)) {
            throw Error(ErrorCode::TooLarge,
                        "the edge length asks for more particles than seed.max_particles = " +
                            std::to_string(options_.max_particles) + "; use a larger edge length");
        }
    }

    // Two points with the boundary farther from one of them than they are from each other lie on
    // the same side: the free ball around it holds both.
    [[nodiscard]] Side side_of(const Vec3& x, double distance, const Vec3& known,
                               double known_distance, Side known_side) const {
        if (known_side != Side::Unknown &&
            (x - known).norm() < std::max(distance, known_distance)) {
            return known_side;
        }
        return domain_.region_at(x) != 0 ? Side::Inside : Side::Outside;
    }

    void ask(Block& block, const Block* parent) const {
        const Vec3 x = middle(block);
        const BoundaryPoint near = domain_.closest(x, parent != nullptr ? parent->facet : kNone);
        block.facet = near.facet;
        block.distance = near.distance;
        block.side = parent != nullptr ? side_of(x, near.distance, middle(*parent),
                                                 parent->distance, parent->side)
                                       : side_of(x, near.distance, x, 0.0, Side::Unknown);
        const double wall = options_.wall_distance * sizing_.h_max();
        const bool is_shallow = shell_ && near.distance + radius(block) > *shell_ * sizing_.h_min();
        block.is_whole = block.side == Side::Inside && near.distance >= radius(block) + wall &&
                         !is_shallow && lowest_h(block) >= kPlateau * sizing_.h_max();
    }

    // No site of the block can be kept.
    [[nodiscard]] bool is_empty(const Block& block) const {
        const bool is_deep = shell_ && block.distance - radius(block) > *shell_ * sizing_.h_max();
        return is_deep || (block.side == Side::Outside && block.distance >= radius(block));
    }

    // Whether a point of a cell is inside, far enough from the wall, and in the shell.
    [[nodiscard]] bool is_free(const Block& block, const Vec3& x, double h) const {
        const Vec3 known = middle(block);
        const double offset = (x - known).norm();
        const double wall = options_.wall_distance * h;
        if (block.distance + offset < wall) {
            return false;
        }
        double distance = block.distance - offset;
        if (distance < wall || shell_) {
            distance = domain_.closest(x, block.facet).distance;
        }
        return distance >= wall && !(shell_ && distance > *shell_ * h) &&
               side_of(x, distance, known, block.distance, block.side) == Side::Inside;
    }

    void choose_sites(Block& block) const {
        for (std::size_t site = 0; site < kSites; ++site) {
            const Vec3 x = origin_ + cell_ * (corner(block) + kLattice[site]);
            const double h = sizing_.h(x);
            if (h >= kPlateau * sizing_.h_max() && is_free(block, x, h)) {
                block.sites |= static_cast<std::uint8_t>(1U << site);
            }
        }
    }

    void emit(const Block& block, const std::array<std::int32_t, 3>& cell, std::int32_t size,
              Particles& particles) const {
        if (size > 1) {
            for (unsigned k = 0; k < 8; ++k) {
                auto part = cell;
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    part[axis] += (k >> axis) & 1U ? size / 2 : 0;
                }
                emit(block, part, size / 2, particles);
            }
            return;
        }
        for (std::size_t site = 0; site < kSites; ++site) {
            if (block.is_whole || (block.sites >> site & 1U) != 0) {
                const Vec3 x = origin_ + cell_ * (Vec3(cell[0], cell[1], cell[2]) + kLattice[site] +
                                                  stir(particles.size()));
                particles.add(x, ParticleKind::Volume, kNone, sizing_.h(x), Vec3::Zero());
            }
        }
    }

    void split(const Block& block, const Vec3& low, double size,
               std::vector<Patch>& patches) const {
        const double h = sizing_.h(low + Vec3::Constant(0.5 * size));
        if (h - sizing_.gradation() * kHalfDiagonal * size >= kPlateau * sizing_.h_max()) {
            return;
        }
        if (size > h) {
            for (unsigned k = 0; k < 8; ++k) {
                const Vec3 step(k & 1U, (k >> 1) & 1U, (k >> 2) & 1U);
                split(block, low + 0.5 * size * step, 0.5 * size, patches);
            }
            return;
        }
        const double darts = std::ceil(kDartsPerVolume * std::pow(size / h, 3));
        patches.push_back({low, size, static_cast<int>(darts), &block});
    }

    void throw_dart(const Patch& patch, std::size_t index, int round, DartGrid& grid,
                    Particles& particles) const {
        const auto random = [&](unsigned axis) {
            return hash_random(options_.seed ^ 0xda27, index,
                               4 * static_cast<std::uint64_t>(round) + axis);
        };
        const Vec3 x = patch.low + patch.size * Vec3(random(0), random(1), random(2));
        const double h = sizing_.h(x);
        const auto too_close = [](Index, double, double) { return true; };
        if (h < kPlateau * sizing_.h_max() && !grid.has_conflict(x, h, too_close) &&
            is_free(*patch.block, x, h)) {
            particles.add(x, ParticleKind::Volume, kNone, h, Vec3::Zero());
            grid.add(x, h);
        }
    }

    const Domain& domain_;
    const SizingField& sizing_;
    std::optional<double> shell_;
    const SeedOptions& options_;
    double cell_;  // Edge of a lattice cell.
    Vec3 origin_ = Vec3::Zero();
    std::int32_t root_size_ = 1;
    double count_ = 0.0;  // Sites in whole blocks.
    std::vector<Block> settled_{};
};

}  // namespace

Particles seed_volume(const Particles& surface, const Domain& domain, const SizingField& sizing,
                      std::optional<double> shell, const SeedOptions& options, RunContext& run) {
    validate(options);
    LatticeFill fill(domain, sizing, shell, options);
    fill.classify(run);
    run.report(0.8);
    Particles particles = surface;
    fill.emit(particles);
    if (!sizing.is_uniform()) {
        fill.throw_darts(particles, run);
    }
    run.report(1.0);
    return particles;
}

}  // namespace remesh
