#include "core/stages/sizing/thickness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace remesh {
namespace {

constexpr double kSampleSpacing = 0.5;  // Over h.
constexpr double kPlateau = 0.86;       // Over the spacing: no place is farther from a probe.
constexpr double kAcrossBody = 0.7;     // Spacing over thickness: less than two layers are coarse.
constexpr double kAcrossGap = 1.0;      // Spacing over the gap to the next wall outside.
constexpr double kTilt = 0.45;          // Tangent of the outer rays' angle to the normal.
constexpr double kOpposite = -0.3;      // Cosine below which a wall faces the other way.
constexpr double kNear = 0.05;          // Rays start this far over h from the surface.
constexpr double kFar = 2.0;            // And end here.

constexpr double kFilled = 0.93;  // Edges across a slab over its thickness in h, as meshed.
constexpr std::size_t kConeRays = 13;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class ThicknessGuard {
public:
    ThicknessGuard(const Domain& domain, double h, double least)
        : domain_(domain), h_(h), least_(least) {}

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
        return std::max(wanted, least_);
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
                            .value_or(kInfinity);
        }
        std::sort(hits.begin(), hits.end());
        return side < 0.0 ? hits[1] : hits[0];
    }

    const Domain& domain_;
    double h_;
    double least_;
};

}  // namespace

std::vector<SizingSample> guard_thickness(const Domain& domain, const SizingField& field,
                                          double least_factor, RunContext& run) {
    const auto spacing_at = [&](const Vec3& middle, double longest) {
        return kSampleSpacing * field.least_within(middle, longest);
    };
    const std::vector<Probe> probes =
        place_probes(domain.boundary(), kSampleSpacing * field.h_min(), spacing_at, run);
    std::vector<double> wanted(probes.size());
    for_each_index(probes.size(), run, [&](std::size_t k) {
        const double h = field.h(probes[k].x);
        const double found = ThicknessGuard(domain, h, least_factor * h).spacing_at(probes[k]);
        wanted[k] = found < kWorthIt * h ? found : kInfinity;
    });
    std::vector<SizingSample> samples;
    for (std::size_t k = 0; k < probes.size(); ++k) {
        if (wanted[k] < kInfinity) {
            samples.push_back({probes[k].x, wanted[k], kPlateau * probes[k].spacing});
        }
    }
    return samples;
}

double size_across(const Domain& domain, const Probe& probe, double elements, double h_max) {
    const BoundaryPoint on = domain.closest(probe.x, probe.facet);
    const double far = kFilled * elements * h_max;
    const Vec3 u = on.normal.unitOrthogonal();
    const Vec3 v = on.normal.cross(u);
    std::array<double, kConeRays> hits{};
    for (std::size_t ray = 0; ray < kConeRays; ++ray) {
        // One along the normal, six at 15 degrees, six at 30.
        const double ring = ray == 0 ? 0.0 : ray <= 6 ? 1.0 : 2.0;
        const double tilt = ring * std::numbers::pi / 12.0;
        const double turn =
            static_cast<double>(ray) * std::numbers::pi / 3.0 + ring * std::numbers::pi / 6.0;
        const Vec3 inward = -std::cos(tilt) * on.normal +
                            std::sin(tilt) * (std::cos(turn) * u + std::sin(turn) * v);
        const auto hit = domain.first_hit(on.point, inward, 1e-3 * far, far / std::cos(tilt),
                                          on.normal, kOpposite);
        hits[ray] = hit ? *hit * std::cos(tilt) : kInfinity;
    }
    std::nth_element(hits.begin(), hits.begin() + kConeRays / 2, hits.end());
    return hits[kConeRays / 2] / (kFilled * elements);
}

}  // namespace remesh
