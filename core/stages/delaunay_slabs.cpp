#include "core/stages/delaunay_slabs.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kLayers = 2.5;               // Of points that a slab sees beyond its own.
constexpr std::size_t kLeastPoints = 20'000;  // Of a slab that is worth a thread.
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Corners of the face opposite of each corner of a tet, facing outward.
constexpr std::array<std::array<std::size_t, 3>, 4> kFaces{
    {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

std::size_t at(Index i) {
    return static_cast<std::size_t>(i);
}

std::size_t points_in_layers(std::size_t points) {
    return static_cast<std::size_t>(kLayers * std::pow(static_cast<double>(points), 2.0 / 3.0)) + 1;
}

/// Along an axis, open on both sides.
struct Interval {
    double low = -kInfinity;
    double high = kInfinity;
};

bool contains(const Interval& outer, const Interval& inner) {
    return outer.low < inner.low && inner.high < outer.high;
}

// What each slab sees: intervals that overlap by some layers of points.
std::vector<Interval> cut(const Points& points, Eigen::Index axis, std::size_t slabs) {
    std::vector<double> along;
    along.reserve(points.size());
    for (const Vec3& p : points) {
        along.push_back(p[axis]);
    }
    const auto of_rank = [&](std::size_t rank) {
        const auto place = along.begin() + static_cast<std::ptrdiff_t>(rank);
        std::nth_element(along.begin(), place, along.end());
        return *place;
    };
    const std::size_t n = points.size();
    const std::size_t layers = points_in_layers(n);
    std::vector<Interval> seen(slabs);
    for (std::size_t i = 1; i < slabs; ++i) {
        const std::size_t rank = i * n / slabs;
        seen[i - 1].high = of_rank(std::min(rank + layers, n - 1));
        seen[i].low = of_rank(rank - std::min(layers, rank));
    }
    return seen;
}

// Of a tet's circumsphere along an axis, rather too long; unbounded where it can't be told.
Interval sphere_extent(const Points& points, const Tet& tet, Eigen::Index axis) {
    constexpr double kFlat = 1e-6;
    constexpr double kMargin = 1e-6;  // Of the radius: a thousand times the rounding error.
    const Vec3& a = points[at(tet[0])];
    const Vec3 u = points[at(tet[1])] - a;
    const Vec3 v = points[at(tet[2])] - a;
    const Vec3 w = points[at(tet[3])] - a;
    const Vec3 vw = v.cross(w);
    const double uu = u.squaredNorm();
    const double vv = v.squaredNorm();
    const double ww = w.squaredNorm();
    const double volume = u.dot(vw);
    if (!(volume > kFlat * std::sqrt(uu * vv * ww))) {
        return {};
    }
    const Vec3 center = (uu * vw + vv * w.cross(u) + ww * u.cross(v)) / (2.0 * volume);
    const double radius = center.norm() * (1.0 + kMargin) + 1e-14 * std::abs(a[axis]);
    return {a[axis] + center[axis] - radius, a[axis] + center[axis] + radius};
}

/// A face of a tet: its vertices in ascending order, and whether outward they are an even
/// permutation of that.
struct Face {
    std::array<Index, 3> vertices;
    bool is_even;
    std::int8_t corner;  ///< Opposite.
    Index tet;
};

Face face_of(const std::vector<Tet>& tets, std::size_t t, std::size_t corner) {
    const Tet& tet = tets[t];
    std::array<Index, 3> v{tet[kFaces[corner][0]], tet[kFaces[corner][1]], tet[kFaces[corner][2]]};
    bool is_even = true;
    const auto order = [&](std::size_t i, std::size_t j) {
        if (v[i] > v[j]) {
            std::swap(v[i], v[j]);
            is_even = !is_even;
        }
    };
    order(0, 1);
    order(1, 2);
    order(0, 1);
    return {v, is_even, static_cast<std::int8_t>(corner), static_cast<Index>(t)};
}

bool operator<(const Face& a, const Face& b) {
    return std::tie(a.vertices, a.is_even) < std::tie(b.vertices, b.is_even);
}

void link(TetComplex& complex, const Face& a, const Face& b) {
    complex.neighbours[at(a.tet)][static_cast<std::size_t>(a.corner)] = b.tet;
    complex.neighbours[at(b.tet)][static_cast<std::size_t>(b.corner)] = a.tet;
}

TetComplex renumbered(TetComplex complex, const std::vector<Index>& vertices) {
    for (Tet& tet : complex.tets) {
        for (Index& v : tet) {
            v = vertices[at(v)];
        }
    }
    return complex;
}

Points selected(const Points& points, const std::vector<Index>& vertices) {
    Points chosen;
    chosen.reserve(vertices.size());
    for (const Index v : vertices) {
        chosen.push_back(points[at(v)]);
    }
    return chosen;
}

// The tets a slab answers for: those that it and no slab before it can vouch for.
TetComplex solve(const Points& points, Eigen::Index axis, const std::vector<Interval>& seen,
                 std::size_t slab) {
    std::vector<Index> members;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i][axis] >= seen[slab].low && points[i][axis] <= seen[slab].high) {
            members.push_back(static_cast<Index>(i));
        }
    }
    const TetComplex all = renumbered(delaunay_cells(selected(points, members)), members);

    std::vector<Index> id(all.tets.size(), kNone);
    TetComplex kept;
    for (std::size_t t = 0; t < all.tets.size(); ++t) {
        const Interval extent = sphere_extent(points, all.tets[t], axis);
        const auto vouches = [&](const Interval& interval) { return contains(interval, extent); };
        const auto mine = seen.begin() + static_cast<std::ptrdiff_t>(slab);
        if (vouches(*mine) && std::none_of(seen.begin(), mine, vouches)) {
            id[t] = static_cast<Index>(kept.tets.size());
            kept.tets.push_back(all.tets[t]);
        }
    }
    kept.neighbours.reserve(kept.tets.size());
    for (std::size_t t = 0; t < all.tets.size(); ++t) {
        if (id[t] != kNone) {
            auto& neighbours = kept.neighbours.emplace_back(all.neighbours[t]);
            for (Index& n : neighbours) {
                n = n == kNone ? kNone : id[at(n)];
            }
        }
    }
    return kept;
}

void append(TetComplex& to, const TetComplex& piece) {
    const auto offset = static_cast<Index>(to.tets.size());
    to.tets.insert(to.tets.end(), piece.tets.begin(), piece.tets.end());
    for (auto neighbours : piece.neighbours) {
        for (Index& n : neighbours) {
            n = n == kNone ? kNone : n + offset;
        }
        to.neighbours.push_back(neighbours);
    }
}

// Links the faces at which two pieces meet. Returns those that are still open, in order.
std::vector<Face> sew(TetComplex& complex) {
    std::vector<Face> open;
    for (std::size_t t = 0; t < complex.tets.size(); ++t) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            if (complex.neighbours[t][corner] == kNone) {
                open.push_back(face_of(complex.tets, t, corner));
            }
        }
    }
    std::sort(open.begin(), open.end());
    std::size_t count = 0;
    for (std::size_t i = 0; i < open.size(); ++i) {
        if (i + 1 < open.size() && open[i].vertices == open[i + 1].vertices) {
            link(complex, open[i], open[i + 1]);
            ++i;
        } else {
            open[count++] = open[i];
        }
    }
    open.resize(count);
    return open;
}

// Vertices of open faces, and those that are in no tet.
std::vector<Index> unfinished(const TetComplex& complex, const std::vector<Face>& open,
                              std::size_t points) {
    std::vector<std::uint8_t> is_finished(points, 0);
    for (const Tet& tet : complex.tets) {
        for (const Index v : tet) {
            is_finished[at(v)] = 1;
        }
    }
    for (const Face& face : open) {
        for (const Index v : face.vertices) {
            is_finished[at(v)] = 0;
        }
    }
    std::vector<Index> vertices;
    for (std::size_t v = 0; v < points; ++v) {
        if (is_finished[v] == 0) {
            vertices.push_back(static_cast<Index>(v));
        }
    }
    return vertices;
}

// Adds the tets of `rest` that lie beyond open faces, up to other open faces.
void fill_in(TetComplex& complex, const std::vector<Face>& open, const TetComplex& rest,
             const RunContext& run) {
    // Per face of the rest: the open face seen from its other side, this one, or none.
    constexpr Index kOwnSide = -2;
    std::vector<std::array<Index, 4>> wall(rest.tets.size());
    for_each_index(rest.tets.size(), run, [&](std::size_t t) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const Face face = face_of(rest.tets, t, corner);
            const auto found = std::lower_bound(
                open.begin(), open.end(), face,
                [](const Face& a, const Face& b) { return a.vertices < b.vertices; });
            Index& here = wall[t][corner];
            if (found == open.end() || found->vertices != face.vertices) {
                here = kNone;
            } else if (found->is_even == face.is_even) {
                here = kOwnSide;
            } else {
                here = static_cast<Index>(found - open.begin());
            }
        }
    });

    std::vector<Index> id(rest.tets.size(), kNone);
    std::vector<Index> added;
    const auto add = [&](std::size_t t) {
        if (id[t] == kNone) {
            id[t] = static_cast<Index>(complex.tets.size() + added.size());
            added.push_back(static_cast<Index>(t));
        }
    };
    for (std::size_t t = 0; t < rest.tets.size(); ++t) {
        if (std::any_of(wall[t].begin(), wall[t].end(), [](Index w) { return w >= 0; })) {
            add(t);
        }
    }
    for (std::size_t next = 0; next < added.size(); ++next) {
        const std::size_t t = at(added[next]);
        for (std::size_t corner = 0; corner < 4; ++corner) {
            if (wall[t][corner] == kNone && rest.neighbours[t][corner] != kNone) {
                add(at(rest.neighbours[t][corner]));
            }
        }
    }
    for (const Index t : added) {
        complex.tets.push_back(rest.tets[at(t)]);
        complex.neighbours.push_back({kNone, kNone, kNone, kNone});
    }
    for (const Index t : added) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const Index w = wall[at(t)][corner];
            const Index n = rest.neighbours[at(t)][corner];
            if (w >= 0) {
                link(complex, open[at(w)],
                     {{}, false, static_cast<std::int8_t>(corner), id[at(t)]});
            } else if (n != kNone) {
                complex.neighbours[at(id[at(t)])][corner] = id[at(n)];
            }
        }
    }
}

}  // namespace

std::size_t worthwhile_slabs(std::size_t points) {
    const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
    // What slabs see twice is to stay a small part.
    const std::size_t most =
        std::min(points / kLeastPoints, points / (6 * points_in_layers(points)));
    return std::clamp<std::size_t>(most, 1, threads);
}

TetComplex delaunay_in_slabs(const Points& points, std::size_t slabs, const RunContext& run) {
    Box box;
    for (const Vec3& p : points) {
        box.include(p);
    }
    Eigen::Index axis = 0;
    (box.high - box.low).maxCoeff(&axis);
    const std::vector<Interval> seen = cut(points, axis, slabs);
    std::vector<TetComplex> pieces(slabs);
    tbb::parallel_for(std::size_t{0}, slabs, [&](std::size_t slab) {
        run.checkpoint();
        pieces[slab] = solve(points, axis, seen, slab);
    });

    TetComplex complex;
    for (TetComplex& piece : pieces) {
        append(complex, piece);
        piece = {};
    }
    const std::vector<Face> open = sew(complex);
    const std::vector<Index> vertices = unfinished(complex, open, points.size());
    run.checkpoint();
    TetComplex rest = renumbered(delaunay_cells(selected(points, vertices)), vertices);
    if (complex.tets.empty()) {
        return rest;
    }
    fill_in(complex, open, rest, run);
    return complex;
}

}  // namespace remesh
