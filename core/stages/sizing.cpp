#include "core/stages/sizing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/error.h"
#include "core/geometry/lipschitz_field.h"
#include "core/geometry/sample_source.h"
#include "core/number_text.h"
#include "core/parallel.h"
#include "core/stages/sizing/curvature.h"
#include "core/stages/sizing/diffused_map.h"
#include "core/stages/sizing/image.h"
#include "core/stages/sizing/probes.h"
#include "core/stages/sizing/regions.h"
#include "core/stages/sizing/thickness.h"

namespace remesh {
namespace {

using Sources = std::vector<std::shared_ptr<const SizingSource>>;

constexpr double kLeastShare = 0.1;      // Of max_size: min_size if nobody says.
constexpr double kStrongest = 1e6;       // Reaction times h^2: nothing spreads any more.
constexpr double kFinestProbes = 0.35;   // Spacing of curvature probes over min_size, at least.
constexpr double kCoarsestProbes = 0.5;  // Spacing of thickness probes over max_size, at most.
constexpr double kMaxProbes = 2e6;       // More are spread wider.
constexpr double kPlateau = 0.5;         // Of a sample over the spacing.

// The guard alone halves h at most, within the depth of a layer or two: a slope of 0.2 would spread
// that over 2.5 h and double the number of tets of a thin body. In a graded map it follows the map.
constexpr double kGuardGradation = 0.5;

constexpr double kMaxGradation = 0.3;  // Quality falls beyond.
constexpr double kMaxGrowth = 1.25;
constexpr std::size_t kMaxRegions = 1000;
constexpr std::size_t kMaxPoints = 100'000;
constexpr std::size_t kMaxName = 255;

double smallest_asked_for(const SizingOptions& options) {
    double least =
        options.layer ? options.layer->first_size : std::numeric_limits<double>::infinity();
    for (const SizingRegion& region : options.regions) {
        least = std::min(least, region.size);
    }
    return least;
}

// Mean edge, each triangle by its area.
double mean_edge(const SurfaceMesh& surface) {
    double sum = 0.0;
    double area = 0.0;
    for (const Triangle& t : surface.triangles) {
        const auto corner = [&](std::size_t k) -> const Vec3& {
            return surface.vertices[static_cast<std::size_t>(t[k])];
        };
        const Vec3 u = corner(1) - corner(0);
        const Vec3 v = corner(2) - corner(0);
        const double weight = u.cross(v).norm();
        sum += weight * (u.norm() + v.norm() + (u - v).norm()) / 3.0;
        area += weight;
    }
    return area > 0.0 ? sum / area : 0.0;
}

double area_of(const SurfaceMesh& surface) {
    double area = 0.0;
    for (const Triangle& t : surface.triangles) {
        const Vec3& a = surface.vertices[static_cast<std::size_t>(t[0])];
        const Vec3& b = surface.vertices[static_cast<std::size_t>(t[1])];
        const Vec3& c = surface.vertices[static_cast<std::size_t>(t[2])];
        area += 0.5 * (b - a).cross(c - a).norm();
    }
    return area;
}

// What curvature or thickness asks for, on points all over the boundary.
class SurfaceSizes {
public:
    SurfaceSizes(const Domain& domain, const FeatureSet& features, const SizingOptions& options,
                 double h_min, double h_max)
        : domain_(domain),
          has_features_(!features.curves.empty()),
          options_(options),
          h_min_(h_min),
          h_max_(h_max),
          spacing_(std::max({mean_edge(domain.boundary()), kFinestProbes * h_min,
                             std::sqrt(area_of(domain.boundary()) / kMaxProbes)})) {}

    // Over several edges of the input, however long they are: one triangle is always flat.
    void add_curvature(std::vector<SizingSample>& samples, RunContext& run) const {
        const std::vector<Probe> probes = probes_at(spacing_, run);
        auto wanted = estimate_curvature(domain_.boundary(), probes, spacing_, has_features_, run);
        for (double& value : wanted) {
            value = std::sqrt(8.0 * *options_.chord_error / std::max(value, 1e-300));
        }
        add(probes, wanted, spacing_, samples, run);
    }

    void add_thickness(std::vector<SizingSample>& samples, RunContext& run) const {
        const double spacing = std::min(spacing_, kCoarsestProbes * h_max_);
        const std::vector<Probe> probes = probes_at(spacing, run);
        std::vector<double> wanted(probes.size());
        for_each_index(probes.size(), run, [&](std::size_t k) {
            wanted[k] = size_across(domain_, probes[k], *options_.elements_across, h_max_);
        });
        add(probes, wanted, spacing, samples, run);
    }

private:
    [[nodiscard]] std::vector<Probe> probes_at(double spacing, const RunContext& run) const {
        return place_probes(
            domain_.boundary(), spacing, [&](const Vec3&, double) { return spacing; }, run);
    }

    void add(const std::vector<Probe>& probes, const std::vector<double>& wanted, double spacing,
             std::vector<SizingSample>& samples, RunContext& run) const {
        const auto smooth =
            median_nearby(domain_.boundary(), probes, wanted, spacing, has_features_, run);
        for (std::size_t k = 0; k < probes.size(); ++k) {
            if (smooth[k] < kWorthIt * h_max_) {
                samples.push_back({probes[k].x, std::max(smooth[k], h_min_), kPlateau * spacing});
            }
        }
    }

    const Domain& domain_;
    bool has_features_;
    const SizingOptions& options_;
    double h_min_;
    double h_max_;
    double spacing_;  // Of what is measured on the input's own triangles.
};

// Sizes at the vertices of the input, interpolated over triangles that are larger than them. NaN
// is no wish, and spreads over the triangles around.
std::vector<SizingSample> sizes_at_vertices(const VertexSizes& wishes, double h_min, double h_max,
                                            const RunContext& run) {
    if (wishes.input == nullptr || wishes.sizes.size() != wishes.input->vertices.size()) {
        throw Error(ErrorCode::InvalidInput,
                    "sizing.vertex_field must be a scalar of the input's vertices, got " +
                        std::to_string(wishes.sizes.size()) + " values");
    }
    const SurfaceMesh& input = *wishes.input;
    std::vector<SizingSample> samples;
    const double spacing = std::max(mean_edge(input), kFinestProbes * h_min);
    const auto probes = place_probes(
        input, spacing, [&](const Vec3&, double) { return spacing; }, run);
    for (const Probe& probe : probes) {
        const Triangle& t = input.triangles[static_cast<std::size_t>(probe.facet)];
        std::array<std::size_t, 3> v{};
        std::transform(t.begin(), t.end(), v.begin(),
                       [](Index i) { return static_cast<std::size_t>(i); });
        const Vec3& a = input.vertices[v[0]];
        const Vec3& b = input.vertices[v[1]];
        const Vec3& c = input.vertices[v[2]];
        const Vec3 normal = (b - a).cross(c - a);
        const double first = (c - b).cross(probe.x - b).dot(normal);
        const double second = (a - c).cross(probe.x - c).dot(normal);
        const double third = normal.squaredNorm() - first - second;
        const double h = (first * wishes.sizes[v[0]] + second * wishes.sizes[v[1]] +
                          third * wishes.sizes[v[2]]) /
                         normal.squaredNorm();
        if (h < kWorthIt * h_max) {
            samples.push_back({probe.x, std::max(h, h_min), kPlateau * spacing});
        }
    }
    return samples;
}

class Checker {
public:
    static void number(const std::string& field, double value, bool is_good,
                       const std::string& range) {
        if (!is_good) {
            throw Error(ErrorCode::InvalidInput,
                        "sizing." + field + " must be " + range + ", got " + number_text(value));
        }
    }
    static void length(const std::string& field, double value) {
        number(field, value, std::isfinite(value) && value > 0.0, "> 0 and finite");
    }
    static void growth(const std::string& field, double value) {
        number(field, value, value > 1.0 && value <= kMaxGrowth, "in (1, 1.25]");
    }
    static void points(const std::string& field, const Points& points, std::size_t fewest) {
        number(field, static_cast<double>(points.size()),
               points.size() >= fewest && points.size() <= kMaxPoints,
               std::to_string(fewest) + " to " + std::to_string(kMaxPoints) + " points");
        for (const Vec3& x : points) {
            finite(field, x);
        }
    }
    static void finite(const std::string& field, const Vec3& x) {
        for (const double value : x) {
            number(field, value, std::isfinite(value), "finite");
        }
    }
};

void check_region(const SizingRegion& region, const std::string& field) {
    Checker::length(field + ".size", region.size);
    if (region.growth) {
        Checker::growth(field + ".growth", *region.growth);
    }
    if (const auto* sphere = std::get_if<SizingSphere>(&region.shape)) {
        Checker::finite(field + ".sphere.center", sphere->center);
        Checker::number(field + ".sphere.radius", sphere->radius,
                        std::isfinite(sphere->radius) && sphere->radius >= 0.0, ">= 0 and finite");
    } else if (const auto* box = std::get_if<SizingBox>(&region.shape)) {
        Checker::finite(field + ".box.low", box->low);
        Checker::finite(field + ".box.high", box->high);
        Checker::number(field + ".box.high", (box->high - box->low).minCoeff(),
                        (box->high.array() >= box->low.array()).all(), "at least box.low");
    } else if (const auto* line = std::get_if<SizingPolyline>(&region.shape)) {
        Checker::points(field + ".polyline", line->points, 2);
    } else {
        Checker::points(field + ".points", std::get<SizingPoints>(region.shape).points, 1);
    }
}

// What asks for sizes that spread by the gradation.
Sources spreading_sources(const Domain& domain, const FeatureSet& features,
                          const SizingOptions& options, double h_min, double h_max, RunContext& run,
                          const VertexSizes& wishes) {
    Sources sources;
    if (options.chord_error || options.elements_across) {
        const SurfaceSizes sizes(domain, features, options, h_min, h_max);
        std::vector<SizingSample> samples;
        if (options.chord_error) {
            sizes.add_curvature(samples, run);
        }
        run.report(0.3);
        if (options.elements_across) {
            sizes.add_thickness(samples, run);
        }
        sources.push_back(std::make_shared<SampleSource>(std::move(samples), options.gradation));
    }
    if (!options.vertex_field.empty()) {
        sources.push_back(std::make_shared<SampleSource>(
            sizes_at_vertices(wishes, h_min, h_max, run), options.gradation));
    }
    if (options.image) {
        sources.push_back(make_image_source(*options.image, domain.boundary(), options.gradation,
                                            h_min, h_max, run));
    }
    for (const SizingRegion& region : options.regions) {
        if (!region.growth) {
            sources.push_back(make_region(region, options.gradation));
        }
    }
    return sources;
}

// What says itself how its sizes grow.
void add_grown_sources(const Domain& domain, const SizingOptions& options, Sources& sources) {
    for (const SizingRegion& region : options.regions) {
        if (region.growth) {
            sources.push_back(make_region(region, options.gradation));
        }
    }
    if (options.layer) {
        sources.push_back(make_layer(domain, *options.layer));
    }
}

}  // namespace

double min_size_of(const SizingOptions& options, double edge_length) {
    const double h_max = options.max_size.value_or(edge_length);
    return options.min_size.value_or(std::min(kLeastShare * h_max, smallest_asked_for(options)));
}

void validate(const SizingOptions& options, std::optional<double> edge_length) {
    Checker::number("min_factor", options.min_factor,
                    options.min_factor > 0.0 && options.min_factor <= 1.0, "in (0, 1]");
    Checker::number("gradation", options.gradation,
                    options.gradation > 0.0 && options.gradation <= kMaxGradation, "in (0, 0.3]");
    if (options.reaction) {
        Checker::number("reaction", *options.reaction,
                        std::isfinite(*options.reaction) && *options.reaction < 0.0,
                        "< 0, or there is no steady state");
        Checker::number("reaction", *options.reaction,
                        options.propagation != Propagation::Lipschitz,
                        "absent where propagation isn't multigrid or coupled");
    }
    for (const auto& [field, value] :
         {std::pair{"min_size", options.min_size}, std::pair{"max_size", options.max_size},
          std::pair{"chord_error", options.chord_error}}) {
        if (value) {
            Checker::length(field, *value);
        }
    }
    const auto max_size = options.max_size ? options.max_size : edge_length;
    if (options.min_size && max_size) {
        Checker::number("min_size", *options.min_size, *options.min_size <= *max_size,
                        "at most " + std::string(options.max_size ? "max_size" : "edge_length") +
                            " = " + number_text(*max_size));
    }
    if (options.elements_across) {
        Checker::number("elements_across", *options.elements_across,
                        *options.elements_across >= 1.0 && *options.elements_across <= 16.0,
                        "in [1, 16]");
    }
    if (options.layer) {
        Checker::length("boundary_layer.first_size", options.layer->first_size);
        Checker::growth("boundary_layer.growth", options.layer->growth);
    }
    Checker::number("vertex_field", static_cast<double>(options.vertex_field.size()),
                    options.vertex_field.size() <= kMaxName, "a name of at most 255 bytes");
    Checker::number("regions", static_cast<double>(options.regions.size()),
                    options.regions.size() <= kMaxRegions, "at most 1000");
    for (std::size_t i = 0; i < options.regions.size(); ++i) {
        check_region(options.regions[i], "regions[" + std::to_string(i) + "]");
    }
}

SizingMap build_sizing_field(const Domain& domain, const FeatureSet& features, double edge_length,
                             const SizingOptions& options, RunContext& run,
                             const VertexSizes& wishes) {
    validate(options, edge_length);
    const double h_max = options.max_size.value_or(edge_length);
    const double h_min = min_size_of(options, edge_length);
    Sources sources = spreading_sources(domain, features, options, h_min, h_max, run, wishes);
    std::optional<MapToSpread> map;
    const LipschitzField demands(sources, h_min, h_max);
    if (options.propagation != Propagation::Lipschitz && !demands.is_uniform()) {
        map = {demands, options.gradation,
               std::max(options.reaction.value_or(
                            reaction_for(demands.h_min(), demands.h_max(), options.gradation)),
                        -kStrongest / (demands.h_min() * demands.h_min()))};
    }
    run.report(0.5);
    if (map && options.propagation == Propagation::Multigrid) {
        sources.push_back(spread_on_coarse_mesh(*map, domain, run));
    }
    add_grown_sources(domain, options, sources);
    run.report(0.7);
    if (options.guard_thickness && options.min_factor < kWorthIt) {
        auto samples =
            guard_thickness(domain, LipschitzField(sources, h_min, h_max), options.min_factor, run);
        if (!samples.empty()) {
            sources.push_back(std::make_shared<SampleSource>(
                std::move(samples), options.is_graded() ? options.gradation : kGuardGradation));
        }
    }
    run.report(1.0);
    LipschitzField field(std::move(sources), h_min, h_max);
    if (field.is_uniform()) {
        return {.field = std::make_shared<UniformSizing>(h_max)};
    }
    if (map && options.propagation == Propagation::Coupled) {
        auto coupled = std::make_shared<CoupledSizing>(std::move(field), std::move(*map));
        return {.field = coupled, .coupled = coupled};
    }
    return {.field = std::make_shared<LipschitzField>(std::move(field))};
}

}  // namespace remesh
