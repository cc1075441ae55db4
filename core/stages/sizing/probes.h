#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/mesh/mesh.h"
#include "core/parallel.h"
#include "core/run_context.h"

namespace remesh {

/// A place on the boundary where something is measured.
struct Probe {
    Vec3 x = Vec3::Zero();
    Index facet = kNone;
    double spacing = 0.0;  ///< To its neighbours, about.
};

namespace detail {

inline constexpr std::size_t kMaxProbes = 40'000'000;

// Probes of one triangle after the other, each with the cell that keeps one of them.
template <typename SpacingAt>
class ProbeCollector {
public:
    ProbeCollector(const Vec3& origin, double finest, SpacingAt spacing_at)
        : origin_(origin), finest_(finest), spacing_at_(spacing_at) {}

    // \param facet  of the triangle a, a + u, a + v
    void add(const Vec3& a, const Vec3& u, const Vec3& v, Index facet) {
        const double longest = std::max({u.norm(), v.norm(), (u - v).norm()});
        const Vec3 middle = a + (u + v) / 3.0;
        const double wanted = spacing_at_(middle, longest);
        if (longest > 8.0 * wanted && wanted < 0.7 * spacing_at_(middle, 0.0)) {
            // Too large to have one spacing.
            add(a, 0.5 * u, 0.5 * v, facet);
            add(a + 0.5 * u, 0.5 * u, 0.5 * v, facet);
            add(a + 0.5 * v, 0.5 * u, 0.5 * v, facet);
            add(a + 0.5 * (u + v), -0.5 * u, -0.5 * v, facet);
            return;
        }
        const double octave = std::clamp(std::floor(std::log2(wanted / finest_)), 0.0, 7.0);
        const double spacing = finest_ * std::exp2(octave);
        const double steps = std::max(1.0, std::ceil(longest / spacing));
        if (0.5 * steps * steps + static_cast<double>(keyed_.size()) >
            static_cast<double>(kMaxProbes)) {
            throw Error(ErrorCode::TooLarge,
                        "the sizes ask for more than " + std::to_string(kMaxProbes) +
                            " places to look at on the surface; use larger ones");
        }
        // Centroids of the triangle's parts when every edge is cut into `steps`.
        const Vec3 normal = u.cross(v);
        for (int i = 0; i < static_cast<int>(steps); ++i) {
            for (int j = 0; i + j < static_cast<int>(steps); ++j) {
                const Vec3 x = a + ((i + 1.0 / 3.0) * u + (j + 1.0 / 3.0) * v) / steps;
                auto key = static_cast<std::uint64_t>(octave);
                for (Eigen::Index axis = 0; axis < 3; ++axis) {
                    const auto along =
                        static_cast<std::uint64_t>((x[axis] - origin_[axis]) / spacing);
                    key = (key << 19) | (along & 0x7ffffU);
                    key = (key << 1) | (normal[axis] < 0.0 ? 1U : 0U);
                }
                keyed_.push_back({key, {x, facet, spacing}});
            }
        }
    }

    // One probe a cell: the first that was added.
    [[nodiscard]] std::vector<Probe> thinned() {
        std::stable_sort(keyed_.begin(), keyed_.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        std::vector<Probe> probes;
        for (std::size_t k = 0; k < keyed_.size(); ++k) {
            if (k == 0 || keyed_[k].first != keyed_[k - 1].first) {
                probes.push_back(keyed_[k].second);
            }
        }
        return probes;
    }

private:
    Vec3 origin_;
    double finest_;
    SpacingAt spacing_at_;
    std::vector<std::pair<std::uint64_t, Probe>> keyed_{};
};

}  // namespace detail

/// Points on all triangles, thinned to one a cell and direction, so that both sides of a thin sheet
/// are probed. The same for any number of threads.
///
/// \param finest      lower bound of the spacings, > 0; they are rounded down to it times a power
/// of two \param spacing_at  spacing_at(x, radius): lower bound of the spacing wanted within a ball
/// \throws Error{TooLarge} for more than 40 million
template <typename SpacingAt>
[[nodiscard]] std::vector<Probe> place_probes(const SurfaceMesh& surface, double finest,
                                              SpacingAt spacing_at, const RunContext& run) {
    const auto vertex = [&](Index i) -> const Vec3& {
        return surface.vertices[static_cast<std::size_t>(i)];
    };
    detail::ProbeCollector<SpacingAt> collector(bounding_box(surface.vertices).low, finest,
                                                spacing_at);
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        if (t % kGrain == 0) {
            run.checkpoint();
        }
        const Vec3& a = vertex(surface.triangles[t][0]);
        collector.add(a, vertex(surface.triangles[t][1]) - a, vertex(surface.triangles[t][2]) - a,
                      static_cast<Index>(t));
    }
    return collector.thinned();
}

}  // namespace remesh
