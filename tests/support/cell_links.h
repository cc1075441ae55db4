#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>

#include "core/exact/delaunay.h"

namespace remesh::testing {

/// Sorted vertices of each tet to those of its neighbours, in the order of the vertices opposite.
using CellLinks = std::map<Tet, std::array<Tet, 4>>;

inline CellLinks links_of(const TetComplex& complex) {
    const auto key = [&](Index t) {
        Tet tet = t == kNone ? Tet{kNone, kNone, kNone, kNone}
                             : complex.tets[static_cast<std::size_t>(t)];
        std::sort(tet.begin(), tet.end());
        return tet;
    };
    CellLinks links;
    for (std::size_t t = 0; t < complex.tets.size(); ++t) {
        const Tet sorted = key(static_cast<Index>(t));
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const auto place =
                std::find(sorted.begin(), sorted.end(), complex.tets[t][corner]) - sorted.begin();
            links[sorted][static_cast<std::size_t>(place)] = key(complex.neighbours[t][corner]);
        }
    }
    return links;
}

}  // namespace remesh::testing
