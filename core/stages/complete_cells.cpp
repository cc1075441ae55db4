#include "core/stages/complete_cells.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "core/mesh/index.h"
#include "core/mesh/tet_corners.h"
#include "core/parallel.h"

namespace remesh {
namespace {

CellFace face_of(const std::vector<Tet>& tets, std::size_t t, std::size_t corner) {
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

bool comes_before(const CellFace& a, const CellFace& b) {
    return std::tie(a.vertices, a.is_even) < std::tie(b.vertices, b.is_even);
}

void link(TetComplex& complex, const CellFace& a, const CellFace& b) {
    complex.neighbours[at(a.tet)][static_cast<std::size_t>(a.corner)] = b.tet;
    complex.neighbours[at(b.tet)][static_cast<std::size_t>(b.corner)] = a.tet;
}

// Vertices of open faces, and those that are in no tet.
std::vector<Index> unfinished(const TetComplex& complex, const std::vector<CellFace>& open,
                              std::size_t points) {
    std::vector<std::uint8_t> is_finished(points, 0);
    for (const Tet& tet : complex.tets) {
        for (const Index v : tet) {
            is_finished[at(v)] = 1;
        }
    }
    for (const CellFace& face : open) {
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
void fill_in(TetComplex& complex, const std::vector<CellFace>& open, const TetComplex& rest,
             const RunContext& run) {
    // Per face of the rest: the open face seen from its other side, this one, or none.
    constexpr Index kOwnSide = -2;
    std::vector<std::array<Index, 4>> wall(rest.tets.size());
    for_each_index(rest.tets.size(), run, [&](std::size_t t) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const CellFace face = face_of(rest.tets, t, corner);
            const auto found = std::lower_bound(
                open.begin(), open.end(), face,
                [](const CellFace& a, const CellFace& b) { return a.vertices < b.vertices; });
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

std::vector<CellFace> sew(TetComplex& complex) {
    std::vector<CellFace> open;
    for (std::size_t t = 0; t < complex.tets.size(); ++t) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            if (complex.neighbours[t][corner] == kNone) {
                open.push_back(face_of(complex.tets, t, corner));
            }
        }
    }
    std::sort(open.begin(), open.end(), comes_before);
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

void complete(TetComplex& complex, const std::vector<CellFace>& open, const Points& points,
              const Triangulate& triangulate, const RunContext& run) {
    const std::vector<Index> vertices = unfinished(complex, open, points.size());
    run.checkpoint();
    TetComplex rest = renumbered(triangulate(selected(points, vertices)), vertices);
    if (complex.tets.empty()) {
        complex = std::move(rest);
    } else {
        fill_in(complex, open, rest, run);
    }
}

}  // namespace remesh
