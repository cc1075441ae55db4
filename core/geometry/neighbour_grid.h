#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/mesh/mesh.h"
#include "core/parallel.h"
#include "core/run_context.h"

namespace remesh {

/// Neighbours of some particles, one list after the other.
struct NeighbourLists {
    std::vector<std::size_t> start{};  ///< Where list k begins; one more than there are lists.
    std::vector<Index> index{};        ///< Neighbours, by position in the grid's points.
};

/// Finds pairs of points closer than `reach` times the mean of their h.
///
/// Points are sorted into rows of a square cross-section along the longest axis of their box, and
/// along each row by position: memory grows with the points and the box's smallest face, never with
/// its volume. One such level for every octave of h.
class NeighbourGrid {
public:
    /// \param points  of which only those in `members` are entered
    /// \param h       #points spacings, > 0
    NeighbourGrid(const Points& points, const std::vector<double>& h,
                  const std::vector<Index>& members, double reach);

    /// Calls `found(j, squared_distance)` for every member j with
    /// |x - x_j| < reach (h + h_j) / 2, in an order that depends on the points only.
    template <typename Found>
    void visit(const Vec3& x, double h, Found found) const {
        for (const Level& level : levels_) {
            visit_level(level, x, h, found);
        }
    }

private:
    struct Entry {
        Vec3 x;
        double h;
        Index id;
    };

    struct Level {
        double h_max = 0.0;                  // Largest h on this level.
        double side = 0.0;                   // Of a row's cross-section.
        std::array<Eigen::Index, 3> axis{};  // Along the rows, then across them.
        Box box{};
        std::array<std::ptrdiff_t, 2> rows{};  // Across.
        std::vector<Index> row_start{};        // Into `along` and `entries`.
        std::vector<double> along{};           // Sorted in each row.
        std::vector<Entry> entries{};
    };

    static Level make_level(const Points& points, const std::vector<double>& h,
                            const std::vector<Index>& members, double reach);

    template <typename Found>
    void visit_level(const Level& level, const Vec3& x, double h, Found& found) const {
        const double radius = 0.5 * reach_ * (h + level.h_max);
        std::array<std::ptrdiff_t, 2> first{};
        std::array<std::ptrdiff_t, 2> last{};
        for (std::size_t k = 0; k < 2; ++k) {
            const Eigen::Index axis = level.axis[k + 1];
            const double offset = x[axis] - level.box.low[axis];
            if (offset < -radius || offset > level.box.high[axis] - level.box.low[axis] + radius) {
                return;
            }
            const auto cell = [&](double at) { return static_cast<std::ptrdiff_t>(at); };
            first[k] = cell(std::max(offset - radius, 0.0) / level.side);
            last[k] =
                std::min(cell(std::max(offset + radius, 0.0) / level.side), level.rows[k] - 1);
        }
        const double low = x[level.axis[0]] - radius;
        const double high = x[level.axis[0]] + radius;
        for (std::ptrdiff_t b = first[1]; b <= last[1]; ++b) {
            for (std::ptrdiff_t a = first[0]; a <= last[0]; ++a) {
                const auto row = static_cast<std::size_t>(b * level.rows[0] + a);
                const auto begin = level.along.begin() + level.row_start[row];
                const auto end = level.along.begin() + level.row_start[row + 1];
                auto at = std::lower_bound(begin, end, low);
                for (; at != end && *at <= high; ++at) {
                    const Entry& entry =
                        level.entries[static_cast<std::size_t>(at - level.along.begin())];
                    const double limit = 0.5 * reach_ * (h + entry.h);
                    const double squared = (entry.x - x).squaredNorm();
                    if (squared < limit * limit) {
                        found(entry.id, squared);
                    }
                }
            }
        }
    }

    double reach_;
    std::vector<Level> levels_{};
};

/// Lists for the points in `rows`: all neighbours j != i of point i for which `accepts(i, j)`.
template <typename Accepts>
NeighbourLists list_neighbours(const NeighbourGrid& grid, const Points& points,
                               const std::vector<double>& h, const std::vector<Index>& rows,
                               const RunContext& run, Accepts accepts) {
    const std::size_t n = rows.size();
    NeighbourLists lists;
    lists.start.assign(n + 1, 0);
    std::vector<std::vector<Index>> blocks((n + kGrain - 1) / kGrain);
    for_each_block(n, kGrain, run, [&](std::size_t begin, std::size_t end) {
        std::vector<Index>& found = blocks[begin / kGrain];
        for (std::size_t k = begin; k < end; ++k) {
            const auto i = static_cast<std::size_t>(rows[k]);
            const std::size_t before = found.size();
            grid.visit(points[i], h[i], [&](Index j, double) {
                if (j != rows[k] && accepts(rows[k], j)) {
                    found.push_back(j);
                }
            });
            lists.start[k + 1] = found.size() - before;
        }
    });
    for (std::size_t k = 0; k < n; ++k) {
        lists.start[k + 1] += lists.start[k];
    }
    lists.index.resize(lists.start[n]);
    for_each_block(n, kGrain, run, [&](std::size_t begin, std::size_t) {
        std::copy(blocks[begin / kGrain].begin(), blocks[begin / kGrain].end(),
                  lists.index.begin() + static_cast<std::ptrdiff_t>(lists.start[begin]));
    });
    return lists;
}

}  // namespace remesh
