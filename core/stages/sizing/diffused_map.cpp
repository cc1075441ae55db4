#include "core/stages/sizing/diffused_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "core/geometry/domain_volume.h"
#include "core/geometry/sample_source.h"
#include "core/mesh/index.h"
#include "core/mesh/tet_corners.h"
#include "core/parallel.h"
#include "core/stages/seed.h"
#include "core/stages/sizing/diffusion.h"
#include "core/stages/tetrahedralize.h"

namespace remesh {
namespace {

constexpr double kCoarse = 2.5;         // Edges of the coarse mesh over the least size.
constexpr double kMostTets = 1e6;       // Of the coarse mesh.
constexpr double kTetsPerVolume = 9.0;  // Of the A15 lattice, per h^3.
constexpr double kFewestAcross = 10.0;  // Edges of the coarse mesh along the diagonal.
constexpr double kVolumeCells = 64.0;   // Across the domain, to know its volume.
constexpr double kInPlace = 0.05;       // Over the spacing: as far from a place is in it.

// Tets between boundary particles may lie outside.
std::vector<Tet> inner_tets(const Particles& particles, const TetComplex& delaunay,
                            const Domain& domain, const RunContext& run) {
    std::vector<char> is_inside(delaunay.tets.size(), 1);
    for_each_index(delaunay.tets.size(), run, [&](std::size_t t) {
        const Tet& tet = delaunay.tets[t];
        Vec3 middle = Vec3::Zero();
        for (const Index i : tet) {
            if (particles.kind[at(i)] == ParticleKind::Volume) {
                return;
            }
            middle += 0.25 * particles.position[at(i)];
        }
        is_inside[t] = domain.region_at(middle) != 0;
    });
    std::vector<Tet> inner;
    inner.reserve(delaunay.tets.size());
    for (std::size_t t = 0; t < delaunay.tets.size(); ++t) {
        if (is_inside[t] != 0) {
            inner.push_back(delaunay.tets[t]);
        }
    }
    return inner;
}

// Holds c where it is known. \return which particles that are
std::vector<char> hold(const MapToSpread& map, const Particles& particles, std::vector<double>& c,
                       const RunContext& run) {
    const double h_max = map.demands.h_max();
    std::vector<char> is_held(particles.size(), 0);
    for_each_index(particles.size(), run, [&](std::size_t i) {
        const Vec3& x = particles.position[i];
        const bool is_volume = particles.kind[i] == ParticleKind::Volume;
        const double h =
            is_volume ? map.demands.h_near_place(x, kInPlace * particles.h[i]) : map.demands.h(x);
        if (!is_volume || h < h_max) {
            is_held[i] = 1;
            c[i] = std::log(h_max / h);
        }
    });
    return is_held;
}

// Balls in which h holds unchanged, so that it goes up from one particle to the next and not above
// both: with slope s over a length L, half of L (1 - s / gradation) at both ends.
std::vector<double> plateaus(const MapToSpread& map, const Points& points,
                             const std::vector<double>& h, const std::vector<Tet>& tets) {
    std::vector<double> length(points.size(), 0.0);
    std::vector<double> slope(points.size(), 0.0);
    std::vector<double> edges(points.size(), 0.0);
    for (const Tet& tet : tets) {
        for (const auto& [p, q] : kEdges) {
            const std::size_t i = at(tet[p]);
            const std::size_t j = at(tet[q]);
            const double distance = (points[i] - points[j]).norm();
            for (const std::size_t end : {i, j}) {
                length[end] += distance;
                edges[end] += 1.0;
                slope[end] = std::max(slope[end], std::abs(h[i] - h[j]) / distance);
            }
        }
    }
    std::vector<double> radius(points.size(), 0.0);
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (edges[i] > 0.0) {
            // Where nothing fills the body, tets reach across it.
            radius[i] = 0.5 * std::min(length[i] / edges[i], kCoarse * h[i]) *
                        std::max(0.0, 1.0 - slope[i] / map.gradation);
        }
    }
    return radius;
}

std::shared_ptr<const SizingSource> source_of(const MapToSpread& map, const Points& points,
                                              const std::vector<double>& c,
                                              const std::vector<Tet>& tets) {
    const double most = std::log(map.demands.h_max() / map.demands.h_min());
    std::vector<double> h(c.size());
    std::transform(c.begin(), c.end(), h.begin(), [&](double value) {
        return map.demands.h_max() * std::exp(-std::clamp(value, 0.0, most));
    });
    const std::vector<double> radius = plateaus(map, points, h, tets);
    std::vector<SizingSample> samples;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (c[i] > 0.0) {
            samples.push_back({.x = points[i], .h = h[i], .radius = radius[i]});
        }
    }
    return std::make_shared<SampleSource>(std::move(samples), map.gradation);
}

double coarse_size(const MapToSpread& map, const Domain& domain, const RunContext& run) {
    const double volume = volume_inside(domain, domain.bounds().diagonal() / kVolumeCells, run);
    return std::min(
        domain.bounds().diagonal() / kFewestAcross,
        std::max(kCoarse * map.demands.h_min(), std::cbrt(kTetsPerVolume * volume / kMostTets)));
}

}  // namespace

// In front of a flat wall c = c0 exp(-d / length) with length = 1 / sqrt(-R), so that the slope of
// h = h_max exp(-c) is h c / length, at most h_max / (e length), where c = 1.
double reaction_for(double h_min, double h_max, double gradation) {
    const double c0 = std::log(h_max / h_min);
    const double steepest = c0 >= 1.0 ? h_max / std::numbers::e : h_min * c0;
    return -std::pow(gradation / steepest, 2);
}

std::shared_ptr<const SizingSource> spread_on_coarse_mesh(const MapToSpread& map,
                                                          const Domain& domain, RunContext& run) {
    const UniformSizing coarse(coarse_size(map, domain, run));
    const SeedOptions options;
    Particles particles = seed_surface(domain, {}, coarse, options, run);
    particles = seed_volume(particles, domain, coarse, std::nullopt, options, run);
    const TetComplex delaunay = tetrahedralize(particles.position, run, particles.lattice);
    std::vector<double> c(particles.size(), 0.0);
    const std::vector<char> is_held = hold(map, particles, c, run);
    const std::vector<Tet> tets = inner_tets(particles, delaunay, domain, run);
    c = diffuse(particles.position, tets, std::move(c), is_held, {.reaction = map.reaction}, run);
    return source_of(map, particles.position, c, tets);
}

CoupledSizing::CoupledSizing(LipschitzField start, MapToSpread map)
    : start_(std::move(start)), map_(std::move(map)) {}

double CoupledSizing::least_within(const Vec3& center, double radius) const {
    const double most = start_.least_within(center, radius);
    return spread_ ? std::max(h_min(), spread_->least_within(center, radius, most)) : most;
}

void CoupledSizing::diffuse(Particles& particles, const TetComplex& delaunay, const Domain& domain,
                            const RunContext& run) {
    c_.resize(particles.size(), 0.0);
    const std::vector<char> is_held = hold(map_, particles, c_, run);
    const std::vector<Tet> tets = inner_tets(particles, delaunay, domain, run);
    c_ = remesh::diffuse(particles.position, tets, std::move(c_), is_held,
                         {.reaction = map_.reaction, .time = -1.0 / map_.reaction}, run);
    spread_ = source_of(map_, particles.position, c_, tets);
    for_each_index(particles.size(), run, [&](std::size_t i) {
        if (particles.kind[i] == ParticleKind::Volume) {
            particles.h[i] = h(particles.position[i]);
        }
    });
}

void CoupledSizing::repopulate(const std::vector<std::array<Index, 2>>& origin) {
    std::vector<double> c;
    c.reserve(origin.size());
    for (const auto& [a, b] : origin) {
        c.push_back(0.5 * (c_[at(a)] + c_[at(b)]));
    }
    c_ = std::move(c);
}

}  // namespace remesh
