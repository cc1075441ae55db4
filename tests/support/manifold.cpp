#include "tests/support/manifold.h"

#include <map>

namespace remesh::testing {

std::string manifold_fault(const std::vector<Triangle>& triangles) {
    // Around a vertex, each triangle leads from one neighbour to the next.
    std::map<Index, std::map<Index, Index>> next_around;
    for (const auto& t : triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
            const auto [place, is_new] = next_around[t[i]].emplace(t[(i + 1) % 3], t[(i + 2) % 3]);
            if (!is_new) {
                return "edge " + std::to_string(t[i]) + " " + std::to_string(place->first) +
                       " is run through twice in one direction";
            }
        }
    }
    for (const auto& [vertex, next] : next_around) {
        std::size_t steps = 0;
        const Index start = next.begin()->first;
        for (Index at = start; steps == 0 || at != start; ++steps) {
            const auto step = next.find(at);
            if (step == next.end() || steps == next.size()) {
                return "vertex " + std::to_string(vertex) + " has an open or tangled fan";
            }
            at = step->second;
        }
        if (steps != next.size()) {
            return "vertex " + std::to_string(vertex) + " has several fans";
        }
    }
    return "";
}

}  // namespace remesh::testing
