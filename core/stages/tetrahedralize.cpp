#include "core/stages/tetrahedralize.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/mesh/tet_corners.h"
#include "core/parallel.h"
#include "core/stages/complete_cells.h"
#include "core/stages/delaunay_slabs.h"
#include "core/stages/lattice_cells.h"

namespace remesh {
namespace {

using Order = std::array<std::size_t, 4>;

// The even permutation that puts the smallest vertex first and the next smallest second or, where
// that would turn the tet inside out, lets the smallest of the other three lead their rotation.
Order canonical_order(const Tet& tet) {
    const auto first =
        static_cast<std::size_t>(std::min_element(tet.begin(), tet.end()) - tet.begin());
    const Order& o = kToFront[first];
    if (tet[o[1]] < tet[o[2]] && tet[o[1]] < tet[o[3]]) {
        return o;
    }
    return tet[o[2]] < tet[o[3]] ? Order{o[0], o[2], o[3], o[1]} : Order{o[0], o[3], o[1], o[2]};
}

template <typename Value>
std::array<Value, 4> permuted(const std::array<Value, 4>& values, const Order& order) {
    return {values[order[0]], values[order[1]], values[order[2]], values[order[3]]};
}

// Tets in ascending order. Counting by first vertex leaves a handful for each, to be sorted.
std::vector<Index> sorted_tets(const std::vector<Tet>& tets, std::size_t vertices,
                               const RunContext& run) {
    std::vector<Index> start(vertices + 1, 0);
    for (const auto& tet : tets) {
        ++start[static_cast<std::size_t>(tet[0]) + 1];
    }
    for (std::size_t v = 0; v < vertices; ++v) {
        start[v + 1] += start[v];
    }
    std::vector<Index> sorted(tets.size());
    auto next = start;
    for (std::size_t t = 0; t < tets.size(); ++t) {
        sorted[static_cast<std::size_t>(next[static_cast<std::size_t>(tets[t][0])]++)] =
            static_cast<Index>(t);
    }
    for_each_index(vertices, run, [&](std::size_t v) {
        std::sort(sorted.begin() + start[v], sorted.begin() + start[v + 1], [&](Index a, Index b) {
            return tets[static_cast<std::size_t>(a)] < tets[static_cast<std::size_t>(b)];
        });
    });
    return sorted;
}

TetComplex canonical(TetComplex raw, std::size_t vertices, const RunContext& run) {
    const std::size_t n = raw.tets.size();
    for_each_index(n, run, [&](std::size_t t) {
        const Order order = canonical_order(raw.tets[t]);
        raw.tets[t] = permuted(raw.tets[t], order);
        raw.neighbours[t] = permuted(raw.neighbours[t], order);
    });

    const std::vector<Index> sorted = sorted_tets(raw.tets, vertices, run);
    std::vector<Index> rank(n);
    for_each_index(n, run, [&](std::size_t i) {
        rank[static_cast<std::size_t>(sorted[i])] = static_cast<Index>(i);
    });

    TetComplex complex;
    complex.tets.resize(n);
    complex.neighbours.resize(n);
    for_each_index(n, run, [&](std::size_t i) {
        const auto from = static_cast<std::size_t>(sorted[i]);
        complex.tets[i] = raw.tets[from];
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const Index other = raw.neighbours[from][corner];
            complex.neighbours[i][corner] =
                other == kNone ? kNone : rank[static_cast<std::size_t>(other)];
        }
    });
    return complex;
}

}  // namespace

TetComplex tetrahedralize(const Points& points, RunContext& run, const Lattice& lattice) {
    run.checkpoint();
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (!points[i].allFinite()) {
            throw Error(ErrorCode::Unmeshable, "point " + std::to_string(i) +
                                                   " of the Delaunay triangulation isn't finite");
        }
    }
    const auto triangulate = [&](const Points& some) {
        const std::size_t slabs = worthwhile_slabs(some.size());
        return slabs > 1 ? delaunay_in_slabs(some, slabs, run) : delaunay_cells(some);
    };
    TetComplex raw;
    if (lattice.cell > 0.0) {
        raw = lattice_cells(points, lattice, run);
        complete(raw, sew(raw), points, triangulate, run);
    } else {
        raw = triangulate(points);
    }
    if (raw.tets.empty()) {
        throw Error(ErrorCode::Unmeshable,
                    "the " + std::to_string(points.size()) + " points span no volume");
    }
    run.report(0.9);
    return canonical(std::move(raw), points.size(), run);
}

}  // namespace remesh
