#include "core/stages/lattice_cells.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/mesh/index.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kOnSite = 0.003;    // Of the cell: what is so near is taken for the site,
constexpr double kClearance = 0.04;  // which changes no sphere by more than this.
constexpr std::size_t kCellTets = 46;
constexpr std::size_t kAround = 27;  // A cell and those around it.
constexpr std::size_t kMiddle = 13;  // Itself.
constexpr std::size_t kParts = 4;    // Along each edge of a cell, to look up spheres.

using Cell = std::array<std::int32_t, 3>;

Cell offset_of(std::size_t around) {
    const auto k = static_cast<std::int32_t>(around);
    return {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
}

std::size_t around_of(const Cell& offset) {
    return static_cast<std::size_t>(offset[0] + 1 + 3 * (offset[1] + 1) + 9 * (offset[2] + 1));
}

Cell cell_of(const Vec3& x) {
    Cell cell{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        cell[axis] = static_cast<std::int32_t>(std::floor(x[static_cast<Eigen::Index>(axis)]));
    }
    return cell;
}

Vec3 corner_of(const Cell& cell) {
    return Vec3(cell[0], cell[1], cell[2]);
}

/// A tet of the ideal lattice, and where its sites and neighbours are, from the cell it counts for.
struct PatternTet {
    std::array<std::uint8_t, 4> site_cell{};  ///< Of the kAround.
    std::array<std::uint8_t, 4> site{};
    std::array<std::uint8_t, 4> next_cell{};  ///< Across the face opposite of each corner.
    std::array<std::uint8_t, 4> next{};
    Vec3 center = Vec3::Zero();  ///< Of its circumsphere, in cells.
    double radius = 0.0;
};

struct Sphere {
    std::uint8_t cell;  ///< Of the kAround, of the tet.
    std::uint8_t tet;
};

/// The Delaunay triangulation of the lattice, a cell of it.
struct Pattern {
    std::array<PatternTet, kCellTets> tets{};
    /// Spheres that reach into a part of a cell.
    std::array<std::vector<Sphere>, kParts * kParts * kParts> reaching{};
};

std::size_t part_of(const Vec3& within) {
    std::size_t part = 0;
    for (Eigen::Index axis = 3; axis-- > 0;) {
        const double scaled = within[axis] * static_cast<double>(kParts);
        part = part * kParts + std::min(static_cast<std::size_t>(scaled), kParts - 1);
    }
    return part;
}

void find_spheres(Pattern& pattern) {
    const double half = 0.5 / static_cast<double>(kParts);
    for (std::size_t part = 0; part < pattern.reaching.size(); ++part) {
        const Vec3 middle((2.0 * static_cast<double>(part % kParts) + 1.0) * half,
                          (2.0 * static_cast<double>(part / kParts % kParts) + 1.0) * half,
                          (2.0 * static_cast<double>(part / kParts / kParts) + 1.0) * half);
        for (std::size_t around = 0; around < kAround; ++around) {
            for (std::size_t t = 0; t < kCellTets; ++t) {
                const PatternTet& tet = pattern.tets[t];
                const double reach = tet.radius + kClearance + std::sqrt(3.0) * half;
                const Vec3 center = tet.center + corner_of(offset_of(around));
                if ((center - middle).norm() < reach) {
                    pattern.reaching[part].push_back(
                        {static_cast<std::uint8_t>(around), static_cast<std::uint8_t>(t)});
                }
            }
        }
    }
}

// Of a few cells of the ideal lattice, those in the middle.
Pattern make_pattern() {
    constexpr int kReach = 2;
    Points sites;
    std::vector<std::pair<Cell, std::uint8_t>> names;
    for (int z = -kReach; z <= kReach; ++z) {
        for (int y = -kReach; y <= kReach; ++y) {
            for (int x = -kReach; x <= kReach; ++x) {
                for (std::uint8_t k = 0; k < kA15Sites.size(); ++k) {
                    sites.push_back(Vec3(x, y, z) + kA15Sites[k]);
                    names.push_back({{x, y, z}, k});
                }
            }
        }
    }
    const TetComplex complex = delaunay_cells(sites);
    const auto home = [&](const Tet& tet) {
        const Vec3 sum =
            sites[at(tet[0])] + sites[at(tet[1])] + sites[at(tet[2])] + sites[at(tet[3])];
        return cell_of(0.25 * sum + Vec3::Constant(1e-6));
    };
    // What a tet is called by its sites, seen from its own cell.
    using Name = std::array<std::array<int, 4>, 4>;
    const auto name_of = [&](const Tet& tet) {
        const Cell cell = home(tet);
        Name name{};
        for (std::size_t k = 0; k < 4; ++k) {
            const auto& [site_cell, site] = names[at(tet[k])];
            name[k] = {site_cell[0] - cell[0], site_cell[1] - cell[1], site_cell[2] - cell[2],
                       site};
        }
        std::sort(name.begin(), name.end());
        return name;
    };

    std::map<Name, std::uint8_t> numbers;
    std::vector<std::size_t> middle;
    for (std::size_t t = 0; t < complex.tets.size(); ++t) {
        if (home(complex.tets[t]) == Cell{0, 0, 0}) {
            numbers[name_of(complex.tets[t])] = static_cast<std::uint8_t>(middle.size());
            middle.push_back(t);
        }
    }
    Pattern pattern;
    for (std::size_t t = 0; t < kCellTets; ++t) {
        const Tet& tet = complex.tets[middle[t]];
        PatternTet& entry = pattern.tets[t];
        Eigen::Matrix3d edges;
        for (std::size_t k = 0; k < 4; ++k) {
            const auto& [site_cell, site] = names[at(tet[k])];
            entry.site_cell[k] = static_cast<std::uint8_t>(around_of(site_cell));
            entry.site[k] = site;
            const Tet& next = complex.tets[at(complex.neighbours[middle[t]][k])];
            entry.next_cell[k] = static_cast<std::uint8_t>(around_of(home(next)));
            entry.next[k] = numbers.at(name_of(next));
            if (k > 0) {
                edges.row(static_cast<Eigen::Index>(k) - 1) = sites[at(tet[k])] - sites[at(tet[0])];
            }
        }
        const Vec3 center = edges.partialPivLu().solve(0.5 * edges.rowwise().squaredNorm());
        entry.center = sites[at(tet[0])] + center;
        entry.radius = center.norm();
    }
    find_spheres(pattern);
    return pattern;
}

const Pattern& pattern() {
    static const Pattern made = make_pattern();
    return made;
}

// Cells of the lattice that hold points, in the order of their keys.
class CellTable {
public:
    struct Entry {
        std::uint64_t key = 0;
        std::uint8_t site = 0;
        Index point = kNone;
    };

    // Beyond these cells a coordinate is no site.
    static constexpr double kFarthest = 1'000'000.0;

    static std::uint64_t key_of(const Cell& cell) {
        constexpr std::int32_t kShift = 1 << 20;
        std::uint64_t key = 0;
        for (const std::int32_t c : cell) {
            key = key << 21 | static_cast<std::uint64_t>(c + kShift);
        }
        return key;
    }

    // Sorted entries; of two points on one site, the first has it.
    explicit CellTable(const std::vector<Entry>& entries, std::vector<std::uint8_t>& is_site) {
        for (const Entry& entry : entries) {
            if (keys_.empty() || keys_.back() != entry.key) {
                keys_.push_back(entry.key);
                sites_.push_back({});
                sites_.back().fill(kNone);
            }
            Index& place = sites_.back()[entry.site];
            if (place == kNone) {
                place = entry.point;
            } else {
                is_site[at(entry.point)] = 0;
            }
        }
    }

    [[nodiscard]] std::size_t size() const { return keys_.size(); }
    [[nodiscard]] Index find(const Cell& cell) const {
        const std::uint64_t key = key_of(cell);
        const auto found = std::lower_bound(keys_.begin(), keys_.end(), key);
        return found != keys_.end() && *found == key ? static_cast<Index>(found - keys_.begin())
                                                     : kNone;
    }
    [[nodiscard]] Cell cell(std::size_t c) const {
        constexpr std::int32_t kShift = 1 << 20;
        constexpr std::uint64_t kMask = (1U << 21) - 1;
        const auto part = [&](int bits) {
            return static_cast<std::int32_t>(keys_[c] >> bits & kMask) - kShift;
        };
        return {part(42), part(21), part(0)};
    }
    [[nodiscard]] Index point(Index cell, std::size_t site) const {
        return cell == kNone ? kNone : sites_[at(cell)][site];
    }

private:
    std::vector<std::uint64_t> keys_{};
    std::vector<std::array<Index, 8>> sites_{};
};

Cell moved(const Cell& cell, std::size_t around) {
    const Cell offset = offset_of(around);
    return {cell[0] + offset[0], cell[1] + offset[1], cell[2] + offset[2]};
}

// The site a point is on, in units of cells from the lattice's origin.
std::optional<std::pair<Cell, std::uint8_t>> site_at(const Vec3& x) {
    if (!(x.cwiseAbs().maxCoeff() < CellTable::kFarthest)) {
        return std::nullopt;
    }
    const Cell cell = cell_of(x + Vec3::Constant(kOnSite));
    const Vec3 within = x - corner_of(cell);
    for (std::uint8_t k = 0; k < kA15Sites.size(); ++k) {
        if ((within - kA15Sites[k]).cwiseAbs().maxCoeff() < kOnSite) {
            return std::pair{cell, k};
        }
    }
    return std::nullopt;
}

using Neighbourhood = std::array<Index, kAround>;

// Which tets of each cell have all of their sites taken, a bit each.
std::vector<std::uint64_t> whole_tets(const CellTable& table,
                                      const std::vector<Neighbourhood>& around,
                                      const RunContext& run) {
    std::vector<std::uint64_t> whole(table.size(), 0);
    for_each_index(table.size(), run, [&](std::size_t c) {
        for (std::size_t t = 0; t < kCellTets; ++t) {
            const PatternTet& tet = pattern().tets[t];
            bool is_whole = true;
            for (std::size_t k = 0; k < 4 && is_whole; ++k) {
                is_whole = table.point(around[c][tet.site_cell[k]], tet.site[k]) != kNone;
            }
            whole[c] |= static_cast<std::uint64_t>(is_whole) << t;
        }
    });
    return whole;
}

// Takes away the tets with points in their spheres that aren't sites.
void drop_disturbed(std::vector<std::uint64_t>& whole, const CellTable& table,
                    const std::vector<Vec3>& scaled, const std::vector<std::uint8_t>& is_site,
                    const RunContext& run) {
    for_each_index(scaled.size(), run, [&](std::size_t i) {
        if (is_site[i] != 0 || !(scaled[i].cwiseAbs().maxCoeff() < CellTable::kFarthest)) {
            return;
        }
        const Cell cell = cell_of(scaled[i]);
        const Vec3 within = scaled[i] - corner_of(cell);
        std::size_t around = kAround;
        Index here = kNone;
        for (const Sphere& sphere : pattern().reaching[part_of(within)]) {
            if (sphere.cell != around) {
                around = sphere.cell;
                here = table.find(moved(cell, around));
            }
            const PatternTet& tet = pattern().tets[sphere.tet];
            const double reach = tet.radius + kClearance;
            const Vec3 center = tet.center + corner_of(offset_of(around));
            if (here != kNone && (within - center).squaredNorm() < reach * reach) {
                std::atomic_ref(whole[at(here)])
                    .fetch_and(~(std::uint64_t{1} << sphere.tet), std::memory_order_relaxed);
            }
        }
    });
}

}  // namespace

TetComplex lattice_cells(const Points& points, const Lattice& lattice, const RunContext& run) {
    const std::size_t n = points.size();
    std::vector<Vec3> scaled(n);
    std::vector<std::uint8_t> is_site(n, 0);
    std::vector<CellTable::Entry> entries(n);
    for_each_index(n, run, [&](std::size_t i) {
        scaled[i] = (points[i] - lattice.origin) / lattice.cell;
        if (const auto site = site_at(scaled[i])) {
            is_site[i] = 1;
            entries[i] = {CellTable::key_of(site->first), site->second, static_cast<Index>(i)};
        }
    });
    std::erase_if(entries, [](const auto& entry) { return entry.point == kNone; });
    std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
        return a.key != b.key ? a.key < b.key : a.point < b.point;
    });
    const CellTable table(entries, is_site);

    std::vector<Neighbourhood> around(table.size());
    for_each_index(table.size(), run, [&](std::size_t c) {
        for (std::size_t k = 0; k < kAround; ++k) {
            around[c][k] = table.find(moved(table.cell(c), k));
        }
    });
    std::vector<std::uint64_t> whole = whole_tets(table, around, run);
    drop_disturbed(whole, table, scaled, is_site, run);

    std::vector<Index> first(table.size() + 1, 0);
    for (std::size_t c = 0; c < table.size(); ++c) {
        first[c + 1] = first[c] + std::popcount(whole[c]);
    }
    const auto id = [&](Index cell, std::size_t t) {
        if (cell == kNone || (whole[at(cell)] >> t & 1U) == 0) {
            return kNone;
        }
        const std::uint64_t before = whole[at(cell)] & ((std::uint64_t{1} << t) - 1);
        return first[at(cell)] + std::popcount(before);
    };
    TetComplex complex;
    complex.tets.resize(at(first.back()));
    complex.neighbours.resize(at(first.back()));
    for_each_index(table.size(), run, [&](std::size_t c) {
        for (std::size_t t = 0; t < kCellTets; ++t) {
            const Index made = id(static_cast<Index>(c), t);
            if (made == kNone) {
                continue;
            }
            const PatternTet& tet = pattern().tets[t];
            for (std::size_t k = 0; k < 4; ++k) {
                complex.tets[at(made)][k] = table.point(around[c][tet.site_cell[k]], tet.site[k]);
                complex.neighbours[at(made)][k] = id(around[c][tet.next_cell[k]], tet.next[k]);
            }
        }
    });
    return complex;
}

}  // namespace remesh
