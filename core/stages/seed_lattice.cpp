#include "core/stages/seed_lattice.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/geometry/spatial_hash.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kCellOverSpacing = 1.833;  // At which A15 is as dense as BCC of that spacing.

}  // namespace

LatticeFill::LatticeFill(const Domain& domain, const SizingField& sizing, const LatticeBand& band,
                         std::optional<double> shell, const SeedOptions& options)
    : domain_(domain),
      sizing_(sizing),
      band_(band),
      shell_(shell),
      options_(options),
      cell_(kCellOverSpacing * options.preload * band.spacing) {
    const Box box = domain.bounds();
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const double shift = hash_random(options.seed, static_cast<std::uint64_t>(axis), 0x1a77);
        origin_[axis] = box.low[axis] - shift * cell_;
    }
    const double cells = (box.high - origin_).maxCoeff() / cell_ + 1.0;
    while (root_size_ < cells && root_size_ < (1 << 30)) {
        root_size_ *= 2;
    }
}

// Refines blocks level by level. One question for the closest point settles a block that the
// boundary doesn't reach.
void LatticeFill::classify(RunContext& run) {
    std::vector<Block> level{Block{.size = root_size_}};
    ask(level[0], nullptr);
    while (!level.empty()) {
        std::vector<Block> parents;
        for (const Block& block : level) {
            if (is_empty(block)) {
                continue;
            }
            if (block.is_whole || block.size == 1) {
                settled_.push_back(block);
                count_ += block.is_whole ? kSites * std::pow(block.size, 3) : 0;
            } else {
                parents.push_back(block);
            }
        }
        check_count(run, 8.0 * static_cast<double>(parents.size()));
        std::vector<Block> next(8 * parents.size());
        for_each_index(next.size(), run, [&](std::size_t k) {
            const Block& parent = parents[k / 8];
            Block& child = next[k];
            child.size = parent.size / 2;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                child.cell[axis] = parent.cell[axis] + ((k >> axis) & 1U ? child.size : 0);
            }
            const Place known = place(parent);
            ask(child, &known);
        });
        level = std::move(next);
    }
    sort_settled();
    for_each_index(settled_.size(), run, [&](std::size_t b) {
        if (!settled_[b].is_whole) {
            choose_sites(settled_[b]);
        }
    });
}

Vec3 LatticeFill::middle(const Block& block) const {
    return origin_ + cell_ * (corner(block) + Vec3::Constant(0.5 * block.size));
}

double LatticeFill::radius(const Block& block) const {
    return kHalfDiagonal * cell_ * block.size;
}

Vec3 LatticeFill::site(const std::array<std::int32_t, 3>& cell, std::size_t k) const {
    return origin_ + cell_ * (Vec3(cell[0], cell[1], cell[2]) + kA15Sites[k]);
}

// A regular lattice has many nearly cospherical points, for which Delaunay needs exact arithmetic;
// stirred by a ten-thousandth of a cell it takes half the time.
Vec3 LatticeFill::stir(std::size_t number) const {
    constexpr double kAmount = 1e-4;
    const auto random = [&](std::uint64_t draw) {
        return kAmount * (hash_random(options_.seed ^ 0x5715, number, draw) - 0.5);
    };
    return {random(0), random(1), random(2)};
}

void LatticeFill::ask(Block& block, const Place* known) const {
    const Vec3 x = middle(block);
    const double reach = radius(block);
    block.least_h = sizing_.least_within(x, reach);
    bool is_all_in_band = block.least_h >= band_.low;
    if (!sizing_.is_uniform()) {
        const double most_h = std::min(sizing_.h_max(), sizing_.h(x) + sizing_.gradation() * reach);
        block.is_in_band = block.least_h < band_.high && most_h >= band_.low;
        is_all_in_band = is_all_in_band && most_h < band_.high;
    }
    if (!block.is_in_band) {
        return;
    }
    const Place here = look_at(x, known);
    block.facet = here.facet;
    block.distance = here.distance;
    block.is_inside = here.is_inside;
    const bool is_shallow = shell_ && here.distance + reach > *shell_ * sizing_.h_min();
    const double wall = band_.wall * std::min(band_.high, sizing_.h_max());
    block.is_whole =
        block.is_inside && here.distance >= reach + wall && !is_shallow && is_all_in_band;
}

LatticeFill::Place LatticeFill::look_at(const Vec3& x, const Place* known) const {
    const BoundaryPoint near = domain_.closest(x, known != nullptr ? known->facet : kNone);
    return {.x = x,
            .distance = near.distance,
            .facet = near.facet,
            .is_inside =
                known != nullptr ? is_inside(*known, x, near.distance) : domain_.region_at(x) != 0};
}

void LatticeFill::choose_sites(Block& block) const {
    for (std::size_t k = 0; k < kSites; ++k) {
        const Vec3 x = site(block.cell, k);
        const double h = sizing_.h(x);
        if (h >= band_.low && h < band_.high && is_free(place(block), x, h, band_.wall)) {
            block.sites |= static_cast<std::uint8_t>(1U << k);
        }
    }
}

// Along a Z-order curve: neighbours in space are neighbours in memory.
void LatticeFill::sort_settled() {
    const Box box{origin_, origin_ + Vec3::Constant(cell_ * root_size_)};
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
}

// No site of the block can be kept.
bool LatticeFill::is_empty(const Block& block) const {
    const bool is_deep = shell_ && block.distance - radius(block) > *shell_ * sizing_.h_max();
    return !block.is_in_band || is_deep || (!block.is_inside && block.distance >= radius(block));
}

// Two points with the boundary farther from one of them than they are from each other lie on the
// same side: the free ball around it holds both.
bool LatticeFill::is_inside(const Place& known, const Vec3& x, double distance) const {
    if ((x - known.x).norm() < std::max(distance, known.distance)) {
        return known.is_inside;
    }
    return domain_.region_at(x) != 0;
}

bool LatticeFill::is_free(const Place& known, const Vec3& x, double h, double wall) const {
    const double offset = (x - known.x).norm();
    if (known.distance + offset < wall * h) {
        return false;
    }
    double distance = known.distance - offset;
    if (distance < wall * h || shell_) {
        distance = domain_.closest(x, known.facet).distance;
    }
    return distance >= wall * h && !(shell_ && distance > *shell_ * h) &&
           is_inside(known, x, distance);
}

void LatticeFill::check_count(RunContext& run, double more) const {
    run.checkpoint();
    if (count_ + more > static_cast<double>(options_.max_particles)) {
        throw Error(ErrorCode::TooLarge,
                    "the edge length asks for more particles than seed.max_particles = " +
                        std::to_string(options_.max_particles) + "; use a larger edge length");
    }
}

}  // namespace remesh
