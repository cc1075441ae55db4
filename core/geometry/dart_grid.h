#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/geometry/spatial_hash.h"
#include "core/mesh/mesh.h"

namespace remesh {

/// Points that keep their distance, in a hash table of cells that grows as they are added.
/// One size of cell for every octave of h, so that a query looks at few cells.
class DartGrid {
public:
    /// \param origin  any point near the darts
    /// \param h_min   lower bound of every h
    /// \param h_max   upper bound of every h
    /// \param reach   largest radius asked for, as a fraction of the mean h of both
    DartGrid(const Vec3& origin, double h_min, double h_max, double reach)
        : origin_(origin), h_min_(h_min), reach_(reach) {
        const double octaves = std::log2(h_max / h_min);
        for (std::size_t l = 0; l <= static_cast<std::size_t>(octaves); ++l) {
            const double level_max = std::min(h_max, h_min * std::exp2(static_cast<double>(l + 1)));
            level_h_.push_back(level_max);
            count_.push_back(0);
        }
        table_.assign(1024, Slot{});
    }

    void add(const Vec3& x, double h) {
        if (2 * (used_ + 1) > table_.size()) {
            grow();
        }
        const std::size_t level = level_of(h);
        const std::uint64_t key = key_of(cell_of(x, level), level);
        Slot& slot = table_[find(key)];
        if (slot.head == kNone) {
            slot.key = key;
            ++used_;
        }
        points_.push_back({x, h, slot.head});
        slot.head = static_cast<Index>(points_.size() - 1);
        ++count_[level];
    }

    /// Whether `conflicts(j, squared_distance, mean_h)` holds for some point j, numbered as added,
    /// within reach * mean_h whose h is neither less than a quarter nor more than four times `h`:
    /// others can't be that near where h is 0.5-Lipschitz.
    template <typename Conflicts>
    [[nodiscard]] bool has_conflict(const Vec3& x, double h, Conflicts conflicts) const {
        for (std::size_t level = 0; level < level_h_.size(); ++level) {
            const bool is_far = level_h_[level] < 0.25 * h || level_h_[level] > 8.0 * h;
            if (count_[level] != 0 && !is_far && has_conflict_on(level, x, h, conflicts)) {
                return true;
            }
        }
        return false;
    }

private:
    using Cell = std::array<std::int64_t, 3>;

    struct Slot {
        std::uint64_t key = 0;
        Index head = kNone;
    };

    struct Point {
        Vec3 x;
        double h;
        Index next;
    };

    template <typename Conflicts>
    bool has_conflict_on(std::size_t level, const Vec3& x, double h, Conflicts& conflicts) const {
        const double radius = 0.5 * reach_ * (h + level_h_[level]);
        const Cell home = cell_of(x, level);
        // The home cell first: that's where most darts fail.
        if (has_conflict_in(key_of(home, level), x, h, conflicts)) {
            return true;
        }
        const Cell low = cell_of(x - Vec3::Constant(radius), level);
        const Cell high = cell_of(x + Vec3::Constant(radius), level);
        for (std::int64_t k = low[2]; k <= high[2]; ++k) {
            for (std::int64_t j = low[1]; j <= high[1]; ++j) {
                for (std::int64_t i = low[0]; i <= high[0]; ++i) {
                    const Cell cell{i, j, k};
                    if (cell != home && has_conflict_in(key_of(cell, level), x, h, conflicts)) {
                        return true;
                    }
                }
            }
        }
        return false;
    }

    template <typename Conflicts>
    bool has_conflict_in(std::uint64_t key, const Vec3& x, double h, Conflicts& conflicts) const {
        for (Index j = table_[find(key)].head; j != kNone;) {
            const Point& point = points_[static_cast<std::size_t>(j)];
            const double mean_h = 0.5 * (h + point.h);
            const double squared = (point.x - x).squaredNorm();
            if (squared < reach_ * reach_ * mean_h * mean_h && conflicts(j, squared, mean_h)) {
                return true;
            }
            j = point.next;
        }
        return false;
    }

    [[nodiscard]] std::size_t level_of(double h) const {
        const auto level = static_cast<std::size_t>(std::max(std::log2(h / h_min_), 0.0));
        return std::min(level, level_h_.size() - 1);
    }

    [[nodiscard]] Cell cell_of(const Vec3& x, std::size_t level) const {
        const double side = reach_ * level_h_[level];
        const auto along = [&](Eigen::Index axis) {
            return static_cast<std::int64_t>(std::floor((x[axis] - origin_[axis]) / side));
        };
        return {along(0), along(1), along(2)};
    }

    [[nodiscard]] static std::uint64_t key_of(const Cell& cell, std::size_t level) {
        const auto bits = [](std::int64_t i) { return static_cast<std::uint64_t>(i) & 0xfffffU; };
        return bits(cell[0]) | (bits(cell[1]) << 20) | (bits(cell[2]) << 40) |
               (static_cast<std::uint64_t>(level & 0xfU) << 60);
    }

    // Slot of a key, or the empty one where it would go.
    [[nodiscard]] std::size_t find(std::uint64_t key) const {
        const std::size_t mask = table_.size() - 1;
        std::size_t at = hash_bits(key) & mask;
        while (table_[at].head != kNone && table_[at].key != key) {
            at = (at + 1) & mask;
        }
        return at;
    }

    void grow() {
        std::vector<Slot> old(2 * table_.size());
        old.swap(table_);
        for (const Slot& slot : old) {
            if (slot.head != kNone) {
                table_[find(slot.key)] = slot;
            }
        }
    }

    Vec3 origin_;
    double h_min_;
    double reach_;
    std::vector<double> level_h_{};
    std::vector<std::size_t> count_{};
    std::vector<Slot> table_{};
    std::vector<Point> points_{};
    std::size_t used_ = 0;
};

}  // namespace remesh
