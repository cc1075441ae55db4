#include "core/geometry/neighbour_grid.h"

#include <cmath>
#include <limits>

#include "core/mesh/index.h"

namespace remesh {
namespace {

// A row count that a box thousands of h wide can't blow up.
constexpr double kMaxRowsPerMember = 8.0;

}  // namespace

NeighbourGrid::NeighbourGrid(const Points& points, const std::vector<double>& h,
                             const std::vector<Index>& members, double reach)
    : reach_(reach) {
    double h_min = std::numeric_limits<double>::infinity();
    for (const Index i : members) {
        h_min = std::min(h_min, h[at(i)]);
    }
    std::vector<std::vector<Index>> octaves;
    for (const Index i : members) {
        const auto octave = static_cast<std::size_t>(std::log2(h[at(i)] / h_min));
        if (octave >= octaves.size()) {
            octaves.resize(octave + 1);
        }
        octaves[octave].push_back(i);
    }
    for (const auto& octave : octaves) {
        if (!octave.empty()) {
            levels_.push_back(make_level(points, h, octave, reach));
        }
    }
}

NeighbourGrid::Level NeighbourGrid::make_level(const Points& points, const std::vector<double>& h,
                                               const std::vector<Index>& members, double reach) {
    Level level;
    for (const Index i : members) {
        level.box.include(points[at(i)]);
        level.h_max = std::max(level.h_max, h[at(i)]);
    }
    const Vec3 size = level.box.high - level.box.low;
    level.axis = {0, 1, 2};
    std::sort(level.axis.begin(), level.axis.end(), [&](Eigen::Index a, Eigen::Index b) {
        return size[a] != size[b] ? size[a] > size[b] : a < b;
    });
    const auto count = static_cast<double>(members.size());
    const double face = size[level.axis[1]] * size[level.axis[2]];
    level.side = std::max({reach * level.h_max, std::sqrt(face / (kMaxRowsPerMember * count)),
                           1e-6 * size[level.axis[1]]});
    for (std::size_t k = 0; k < 2; ++k) {
        level.rows[k] = static_cast<std::ptrdiff_t>(size[level.axis[k + 1]] / level.side) + 1;
    }

    const auto row_of = [&](const Vec3& x) {
        std::array<std::ptrdiff_t, 2> cell{};
        for (std::size_t k = 0; k < 2; ++k) {
            const Eigen::Index axis = level.axis[k + 1];
            cell[k] =
                std::min(static_cast<std::ptrdiff_t>((x[axis] - level.box.low[axis]) / level.side),
                         level.rows[k] - 1);
        }
        return static_cast<std::size_t>(cell[1] * level.rows[0] + cell[0]);
    };
    level.row_start.assign(static_cast<std::size_t>(level.rows[0] * level.rows[1]) + 1, 0);
    for (const Index i : members) {
        ++level.row_start[row_of(points[at(i)]) + 1];
    }
    for (std::size_t row = 1; row < level.row_start.size(); ++row) {
        level.row_start[row] += level.row_start[row - 1];
    }
    level.entries.resize(members.size());
    std::vector<Index> next(level.row_start.begin(), level.row_start.end() - 1);
    for (const Index i : members) {
        const std::size_t slot = at(next[row_of(points[at(i)])]++);
        level.entries[slot] = {points[at(i)], h[at(i)], i};
    }
    for (std::size_t row = 0; row + 1 < level.row_start.size(); ++row) {
        std::sort(level.entries.begin() + level.row_start[row],
                  level.entries.begin() + level.row_start[row + 1],
                  [axis = level.axis[0]](const Entry& a, const Entry& b) {
                      return a.x[axis] != b.x[axis] ? a.x[axis] < b.x[axis] : a.id < b.id;
                  });
    }
    level.along.resize(level.entries.size());
    for (std::size_t k = 0; k < level.along.size(); ++k) {
        level.along[k] = level.entries[k].x[level.axis[0]];
    }
    return level;
}

}  // namespace remesh
