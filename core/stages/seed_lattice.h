#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/geometry/domain.h"
#include "core/geometry/lattice.h"
#include "core/geometry/particles.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"
#include "core/stages/seed.h"

namespace remesh {

inline constexpr double kHalfDiagonal = 0.8660254037844386;  ///< Of a cube, over its edge.

/// Spacings that one lattice stands for.
struct LatticeBand {
    double low = 0.0;  ///< Sites with less h are left to other bands.
    double high = std::numeric_limits<double>::infinity();  ///< And those with this much or more.
    double spacing = 0.0;  ///< Of the lattice, before it is preloaded.
    double wall = 0.0;     ///< Sites closer to the boundary than this times h are dropped.
};

/// The sites of an A15 lattice that lie inside a domain and in a band of spacings.
///
/// A tree of blocks is refined towards the boundary and the edges of the band, so that most sites
/// are settled by the block, not one by one.
class LatticeFill {
public:
    /// \param shell  only this many h deep from the boundary, if given
    LatticeFill(const Domain& domain, const SizingField& sizing, const LatticeBand& band,
                std::optional<double> shell, const SeedOptions& options);

    /// Finds the blocks whose sites are kept.
    /// \throws Error{TooLarge} for more sites than options.max_particles; Error{Cancelled}
    void classify(RunContext& run);

    /// Calls found(x, h) for every site kept, in Z-order. `first` numbers the first one: sites are
    /// stirred by their number.
    template <typename Found>
    void visit(std::size_t first, Found found) const {
        for (const Block& block : settled_) {
            visit(block, block.cell, block.size, first, found);
        }
    }

    [[nodiscard]] Lattice lattice() const { return {origin_, cell_}; }

    /// A point whose distance from the boundary and side of it are known.
    struct Place {
        Vec3 x = Vec3::Zero();
        double distance = 0.0;
        Index facet = kNone;
        bool is_inside = false;
    };

    /// What is known about a point, with the help of another one.
    [[nodiscard]] Place look_at(const Vec3& x, const Place* known) const;

    /// Whether a point with spacing h is inside, at least `wall` h from the boundary and in the
    /// shell, of which a place nearby often tells.
    [[nodiscard]] bool is_free(const Place& known, const Vec3& x, double h, double wall) const;

private:
    static constexpr std::size_t kSites = 8;  // Of A15 in a cell.

    // A cube of lattice cells, and what is known about its middle.
    struct Block {
        std::array<std::int32_t, 3> cell{};  // Its lowest cell.
        std::int32_t size = 1;               // Cells along an edge: a power of two.
        Index facet = kNone;                 // Of the boundary closest to the middle.
        double distance = 0.0;               // Of the middle from the boundary.
        double least_h = 0.0;                // Lower bound of h in the block.
        bool is_inside = false;              // The middle.
        bool is_in_band = true;              // Some of the block may be.
        bool is_whole = false;               // All sites are kept.
        std::uint8_t sites = 0;              // Bits of the sites kept, for a single cell.
    };

    static Vec3 corner(const Block& block) {
        return Vec3(block.cell[0], block.cell[1], block.cell[2]);
    }
    [[nodiscard]] Vec3 middle(const Block& block) const;
    [[nodiscard]] double radius(const Block& block) const;
    [[nodiscard]] Place place(const Block& block) const {
        return {middle(block), block.distance, block.facet, block.is_inside};
    }
    [[nodiscard]] Vec3 site(const std::array<std::int32_t, 3>& cell, std::size_t k) const;
    [[nodiscard]] Vec3 stir(std::size_t number) const;

    void ask(Block& block, const Place* known) const;
    void choose_sites(Block& block) const;
    void sort_settled();
    [[nodiscard]] bool is_empty(const Block& block) const;
    [[nodiscard]] bool is_inside(const Place& known, const Vec3& x, double distance) const;
    void check_count(RunContext& run, double more) const;

    template <typename Found>
    void visit(const Block& block, const std::array<std::int32_t, 3>& cell, std::int32_t size,
               std::size_t& number, Found& found) const {
        if (size > 1) {
            for (unsigned k = 0; k < 8; ++k) {
                auto part = cell;
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    part[axis] += (k >> axis) & 1U ? size / 2 : 0;
                }
                visit(block, part, size / 2, number, found);
            }
            return;
        }
        for (std::size_t k = 0; k < kSites; ++k) {
            if (block.is_whole || (block.sites >> k & 1U) != 0) {
                const Vec3 x = site(cell, k) + cell_ * stir(number++);
                const bool is_coarsest = block.least_h >= sizing_.h_max();
                found(x, is_coarsest ? sizing_.h_max() : sizing_.h(x));
            }
        }
    }

    const Domain& domain_;
    const SizingField& sizing_;
    LatticeBand band_;
    std::optional<double> shell_;
    const SeedOptions& options_;
    double cell_;  // Edge of a lattice cell.
    Vec3 origin_ = Vec3::Zero();
    std::int32_t root_size_ = 1;
    double count_ = 0.0;  // Sites in whole blocks.
    std::vector<Block> settled_{};
};

}  // namespace remesh
