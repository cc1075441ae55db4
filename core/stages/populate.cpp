#include "core/stages/populate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

#include "core/error.h"
#include "core/mesh/index.h"
#include "core/mesh/tet_corners.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kTooLong = 1.35;  // Over h: edges that get a particle,
constexpr double kTooShort = 0.7;  // and that lose one.
constexpr double kWall = 0.45;     // New particles keep this far over h from the boundary.

struct Edge {
    double ratio;  // Length over the mean h of its ends.
    Index a;
    Index b;

    [[nodiscard]] auto key() const { return std::tie(ratio, a, b); }
};

class Census {
public:
    Census(const Particles& particles, const TetComplex& delaunay, const RunContext& run)
        : particles_(particles),
          sum_(particles.size(), 0.0),
          count_(particles.size(), 0),
          is_taken_(particles.size(), 0) {
        for (std::size_t t = 0; t < delaunay.tets.size(); ++t) {
            if (t % kGrain == 0) {
                run.checkpoint();
            }
            for (const auto& [i, j] : kEdges) {
                add(delaunay.tets[t][i], delaunay.tets[t][j]);
            }
        }
        const auto same = [](const Edge& a, const Edge& b) { return a.a == b.a && a.b == b.b; };
        for (auto* edges : {&short_, &long_}) {
            std::sort(edges->begin(), edges->end(),
                      [](const Edge& a, const Edge& b) { return a.key() < b.key(); });
            edges->erase(std::unique(edges->begin(), edges->end(), same), edges->end());
        }
    }

    // Particles that go: shortest edges first.
    [[nodiscard]] std::vector<char> removed() {
        std::vector<char> goes(particles_.size(), 0);
        for (const Edge& edge : short_) {
            if (take(edge)) {
                goes[at(more_crowded(edge))] = 1;
            }
        }
        return goes;
    }

    // Edges that get a particle in their middle: longest first.
    [[nodiscard]] std::vector<std::array<Index, 2>> divided() {
        std::vector<std::array<Index, 2>> ends;
        for (auto edge = long_.rbegin(); edge != long_.rend(); ++edge) {
            if (take(*edge)) {
                ends.push_back({edge->a, edge->b});
            }
        }
        return ends;
    }

private:
    void add(Index i, Index j) {
        if (is_bound(i) && is_bound(j)) {
            return;
        }
        const Edge edge{(particles_.position[at(i)] - particles_.position[at(j)]).norm() /
                            (0.5 * (particles_.h[at(i)] + particles_.h[at(j)])),
                        std::min(i, j), std::max(i, j)};
        for (const Index end : {i, j}) {
            sum_[at(end)] += edge.ratio;
            ++count_[at(end)];
        }
        if (edge.ratio < kTooShort) {
            short_.push_back(edge);
        } else if (edge.ratio > kTooLong) {
            long_.push_back(edge);
        }
    }

    [[nodiscard]] bool is_bound(Index i) const {
        return particles_.kind[at(i)] != ParticleKind::Volume;
    }

    bool take(const Edge& edge) {
        if (is_taken_[at(edge.a)] != 0 || is_taken_[at(edge.b)] != 0) {
            return false;
        }
        is_taken_[at(edge.a)] = is_taken_[at(edge.b)] = 1;
        return true;
    }

    [[nodiscard]] Index more_crowded(const Edge& edge) const {
        if (is_bound(edge.a) || is_bound(edge.b)) {
            return is_bound(edge.a) ? edge.b : edge.a;
        }
        return sum_[at(edge.a)] / count_[at(edge.a)] < sum_[at(edge.b)] / count_[at(edge.b)]
                   ? edge.a
                   : edge.b;
    }

    const Particles& particles_;
    std::vector<double> sum_;  // Of the ratios of a particle's edges, once for each tet.
    std::vector<std::int32_t> count_;
    std::vector<char> is_taken_;
    std::vector<Edge> short_{};
    std::vector<Edge> long_{};
};

}  // namespace

void validate(const PopulationOptions& options) {
    if (options.passes < 0 || options.passes > 20) {
        throw Error(ErrorCode::InvalidInput,
                    "population.passes must be in [0, 20], got " + std::to_string(options.passes));
    }
}

PopulationResult control_population(const Particles& particles, const TetComplex& delaunay,
                                    const Domain& domain, const SizingField& sizing,
                                    RunContext& run) {
    Census census(particles, delaunay, run);
    const std::vector<char> goes = census.removed();
    const std::vector<std::array<Index, 2>> divided = census.divided();

    Points middles(divided.size());
    std::vector<double> h(divided.size(), 0.0);  // Or 0 for one that can't be.
    for_each_index(divided.size(), run, [&](std::size_t k) {
        const auto& [a, b] = divided[k];
        middles[k] = 0.5 * (particles.position[at(a)] + particles.position[at(b)]);
        const double wanted = sizing.h(middles[k]);
        if (!domain.closest_within(middles[k], kWall * wanted) &&
            domain.region_at(middles[k]) != 0) {
            h[k] = wanted;
        }
    });

    PopulationResult result;
    result.particles.lattice = particles.lattice;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (goes[i] == 0) {
            result.particles.add(particles.position[i], particles.kind[i], particles.anchor[i],
                                 particles.h[i], particles.normal[i]);
            result.origin.push_back({static_cast<Index>(i), static_cast<Index>(i)});
        }
    }
    result.removed = static_cast<std::int64_t>(particles.size() - result.particles.size());
    for (std::size_t k = 0; k < middles.size(); ++k) {
        if (h[k] > 0.0) {
            result.particles.add(middles[k], ParticleKind::Volume, kNone, h[k], Vec3::Zero());
            result.origin.push_back(divided[k]);
            ++result.inserted;
        }
    }
    return result;
}

}  // namespace remesh
