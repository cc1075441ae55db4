#include "core/stages/sizing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/geometry/lipschitz_field.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kSampleSpacing = 0.5;  // Over h.
constexpr double kPlateau = 0.43;       // Over h: no place of the surface is farther from a probe.
constexpr double kAcrossBody = 0.7;     // Spacing over thickness: less than two layers are coarse.
constexpr double kAcrossGap = 1.0;      // Spacing over the gap to the next wall outside.
constexpr double kWorthIt = 0.97;       // Refinement by less than this isn't worth a graded field.
constexpr double kTilt = 0.45;          // Tangent of the outer rays' angle to the normal.
constexpr double kOpposite = -0.3;      // Cosine below which a wall faces the other way.
constexpr double kNear = 0.05;          // Rays start this far over h from the surface.
constexpr double kFar = 2.0;            // And end here.

std::size_t at(Index i) {
    return static_cast<std::size_t>(i);
}

// A place on the boundary where thickness is measured.
struct Probe {
    std::uint64_t cell;  // One probe a cell and side of the surface.
    Vec3 x;
    Index facet;
};

// Points on all triangles, about `spacing` apart, thinned to one a cell and direction, so that
// both sides of a thin sheet are probed. The same for every order of threads, since serial.
std::vector<Probe> place_probes(const SurfaceMesh& surface, const Box& box, double spacing,
                                const RunContext& run) {
    std::vector<Probe> probes;
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        if (t % kGrain == 0) {
            run.checkpoint();
        }
        const Vec3& a = surface.vertices[at(surface.triangles[t][0])];
        const Vec3 u = surface.vertices[at(surface.triangles[t][1])] - a;
        const Vec3 v = surface.vertices[at(surface.triangles[t][2])] - a;
        const Vec3 normal = u.cross(v);
        const double longest = std::max({u.norm(), v.norm(), (u - v).norm()});
        const int steps = std::max(1, static_cast<int>(std::ceil(longest / spacing)));
        // Centroids of the triangle's parts when every edge is cut into `steps`.
        for (int i = 0; i < steps; ++i) {
            for (int j = 0; i + j < steps; ++j) {
                const Vec3 x = a + ((i + 1.0 / 3.0) * u + (j + 1.0 / 3.0) * v) / steps;
                std::uint64_t key = 0;
                for (Eigen::Index axis = 0; axis < 3; ++axis) {
                    const auto along =
                        static_cast<std::uint64_t>((x[axis] - box.low[axis]) / spacing);
                    key = (key << 20) | (along & 0xfffffU);
                    key = (key << 1) | (normal[axis] < 0.0 ? 1U : 0U);
                }
                probes.push_back({key, x, static_cast<Index>(t)});
            }
        }
    }
    std::stable_sort(probes.begin(), probes.end(),
                     [](const Probe& a, const Probe& b) { return a.cell < b.cell; });
    const auto last = std::unique(probes.begin(), probes.end(),
                                  [](const Probe& a, const Probe& b) { return a.cell == b.cell; });
    probes.erase(last, probes.end());
    return probes;
}

class ThicknessGuard {
public:
    ThicknessGuard(const Domain& domain, const SizingOptions& options)
        : domain_(domain), h_(options.edge_length), least_(options.min_factor) {}

    // Spacing wanted at a probe.
    [[nodiscard]] double spacing_at(const Probe& probe) const {
        const BoundaryPoint on = domain_.closest(probe.x, probe.facet);
        double wanted = h_;
        if (!has_room(on, -h_ / kAcrossBody)) {
            wanted = std::min(wanted, kAcrossBody * across(on, -1.0));
        }
        if (!has_room(on, h_ / kAcrossGap)) {
            wanted = std::min(wanted, kAcrossGap * across(on, 1.0));
        }
        return std::max(wanted, least_ * h_);
    }

private:
    // Whether a ball of that diameter fits against the boundary, on the inner side if negative: one
    // question that spares the rays nearly everywhere.
    [[nodiscard]] bool has_room(const BoundaryPoint& on, double diameter) const {
        const Vec3 center = on.point + 0.5 * diameter * on.normal;
        return !domain_.closest_within(center, 0.97 * 0.5 * std::abs(diameter), on.facet);
    }

    // Distance to the opposite wall, inward (side -1) or outward (+1): the shortest of five rays
    // outward, the second shortest inward, where a single ray may leave through a dent.
    [[nodiscard]] double across(const BoundaryPoint& on, double side) const {
        const Vec3& n = on.normal;
        const Vec3 u = n.unitOrthogonal();
        const Vec3 v = n.cross(u);
        const std::array<Vec3, 5> directions{
            n, (n + kTilt * u).normalized(), (n - kTilt * u).normalized(),
            (n + kTilt * v).normalized(), (n - kTilt * v).normalized()};
        std::array<double, 5> hits{};
        for (std::size_t ray = 0; ray < hits.size(); ++ray) {
            hits[ray] = domain_
                            .first_hit(on.point, side * directions[ray], kNear * h_, kFar * h_, n,
                                       kOpposite)
                            .value_or(std::numeric_limits<double>::infinity());
        }
        std::sort(hits.begin(), hits.end());
        return side < 0.0 ? hits[1] : hits[0];
    }

    const Domain& domain_;
    double h_;
    double least_;
};

}  // namespace

void validate(const SizingOptions& options) {
    const auto check = [](const char* field, double value, bool is_good, const char* range) {
        if (!is_good) {
            throw Error(ErrorCode::InvalidInput, std::string("sizing.") + field + " must be " +
                                                     range + ", got " + std::to_string(value));
        }
    };
    check("edge_length", options.edge_length,
          std::isfinite(options.edge_length) && options.edge_length > 0.0, "> 0 and finite");
    check("min_factor", options.min_factor, options.min_factor > 0.0 && options.min_factor <= 1.0,
          "in (0, 1]");
    check("gradation", options.gradation, options.gradation > 0.0 && options.gradation <= 1.0,
          "in (0, 1]");
}

std::shared_ptr<const SizingField> build_sizing_field(const Domain& domain,
                                                      const SizingOptions& options,
                                                      RunContext& run) {
    validate(options);
    const double h = options.edge_length;
    if (!options.guard_thickness || options.min_factor >= kWorthIt) {
        return std::make_shared<UniformSizing>(h);
    }
    const std::vector<Probe> probes =
        place_probes(domain.boundary(), domain.bounds(), kSampleSpacing * h, run);
    run.report(0.2);

    const ThicknessGuard guard(domain, options);
    std::vector<double> wanted(probes.size());
    for_each_index(probes.size(), run,
                   [&](std::size_t k) { wanted[k] = guard.spacing_at(probes[k]); });
    std::vector<SizingSample> samples;
    for (std::size_t k = 0; k < probes.size(); ++k) {
        if (wanted[k] < kWorthIt * h) {
            samples.push_back({probes[k].x, wanted[k]});
        }
    }
    run.report(1.0);
    if (samples.empty()) {
        return std::make_shared<UniformSizing>(h);
    }
    return std::make_shared<LipschitzField>(std::move(samples), h, options.gradation, kPlateau * h);
}

}  // namespace remesh
