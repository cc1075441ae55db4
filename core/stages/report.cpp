#include "core/stages/report.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/geometry/bvh.h"
#include "core/mesh/quality.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr std::size_t kManyTriangles = 100'000;  // Of which the vertices are samples enough.

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Sorts a copy of nothing: `values` is taken by value since the quantile needs an order of its
/// own.
Summary summarize(std::vector<double> values, Histogram histogram, std::size_t bins) {
    Summary summary;
    summary.count = static_cast<std::int64_t>(values.size());
    histogram.counts.assign(bins, 0);
    if (!values.empty()) {
        summary.mean = sum_over(values.size(), [&](std::size_t i) { return values[i]; }) /
                       static_cast<double>(values.size());
        const double scale = static_cast<double>(bins) / (histogram.high - histogram.low);
        for (const double value : values) {
            const double bin =
                std::clamp((value - histogram.low) * scale, 0.0, static_cast<double>(bins) - 1.0);
            ++histogram.counts[static_cast<std::size_t>(bin)];
        }
        const auto [least, most] = std::minmax_element(values.begin(), values.end());
        summary.min = *least;
        summary.max = *most;
        const auto percent = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 100);
        std::nth_element(values.begin(), percent, values.end());
        summary.first_percentile = *percent;
    }
    summary.histogram = std::move(histogram);
    return summary;
}

const Vec3& corner(const Points& points, Index i) {
    return points[static_cast<std::size_t>(i)];
}

/// Each undirected edge once, sorted.
std::vector<std::pair<Index, Index>> edges_of(const std::vector<Triangle>& triangles) {
    std::vector<std::pair<Index, Index>> edges;
    edges.reserve(triangles.size() * 3);
    for (const auto& t : triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
            edges.push_back(std::minmax(t[i], t[(i + 1) % 3]));
        }
    }
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    return edges;
}

/// Number of connected parts among the vertices that have an edge, and of those vertices.
std::pair<std::int64_t, std::int64_t> count_parts(
    std::size_t vertices, const std::vector<std::pair<Index, Index>>& edges) {
    std::vector<Index> parent(vertices, kNone);
    const auto root = [&](Index v) {
        while (parent[static_cast<std::size_t>(v)] != v) {
            auto& up = parent[static_cast<std::size_t>(v)];
            up = parent[static_cast<std::size_t>(up)];
            v = up;
        }
        return v;
    };
    std::int64_t parts = 0;
    std::int64_t used = 0;
    for (const auto& [a, b] : edges) {
        for (const Index v : {a, b}) {
            if (parent[static_cast<std::size_t>(v)] == kNone) {
                parent[static_cast<std::size_t>(v)] = v;
                ++parts;
                ++used;
            }
        }
        const Index ra = root(a);
        const Index rb = root(b);
        if (ra != rb) {
            parent[static_cast<std::size_t>(rb)] = ra;
            --parts;
        }
    }
    return {parts, used};
}

nlohmann::json json_of(const Histogram& histogram) {
    return {{"low", histogram.low}, {"high", histogram.high}, {"counts", histogram.counts}};
}

nlohmann::json json_of(const Summary& summary) {
    return {{"count", summary.count},
            {"min", summary.min},
            {"first_percentile", summary.first_percentile},
            {"mean", summary.mean},
            {"max", summary.max},
            {"histogram", json_of(summary.histogram)}};
}

nlohmann::json json_of(const SurfaceQuality& quality) {
    return {{"vertices", quality.vertices},
            {"triangles", quality.triangles},
            {"components", quality.components},
            {"euler_characteristic", quality.euler_characteristic},
            {"area", quality.area},
            {"volume", quality.volume},
            {"radius_ratio", json_of(quality.radius_ratio)},
            {"min_angle", json_of(quality.min_angle)},
            {"edge_length", json_of(quality.edge_length)}};
}

nlohmann::json json_of(const TetQuality& quality) {
    return {{"tets", quality.tets},
            {"volume", quality.volume},
            {"radius_ratio", json_of(quality.radius_ratio)},
            {"dihedral", json_of(quality.dihedral)},
            {"min_dihedral", quality.min_dihedral}};
}

nlohmann::json json_of(const Deviation& deviation) {
    return {{"max", deviation.max}, {"p99", deviation.p99}, {"rms", deviation.rms}};
}

nlohmann::json json_of(const Vec3& point) {
    return {point.x(), point.y(), point.z()};
}

nlohmann::json json_of(const Defect& defect) {
    nlohmann::json json{
        {"code", defect.code}, {"description", defect.description}, {"count", defect.count}};
    if (defect.at) {
        json["at"] = json_of(*defect.at);
    }
    return json;
}

nlohmann::json json_of(const InputFacts& facts) {
    return {{"vertices", facts.vertices},
            {"triangles", facts.triangles},
            {"components", facts.components},
            {"boundary_edges", facts.boundary_edges},
            {"boundary_loops", facts.boundary_loops},
            {"non_manifold_edges", facts.non_manifold_edges},
            {"inconsistent_edges", facts.inconsistent_edges},
            {"duplicate_triangles", facts.duplicate_triangles},
            {"degenerate_triangles", facts.degenerate_triangles},
            {"area", facts.area},
            {"volume", facts.volume},
            {"mean_edge", facts.mean_edge},
            {"sharp_edge_density", facts.sharp_edge_density},
            {"bounds", {{"low", json_of(facts.bounds.low)}, {"high", json_of(facts.bounds.high)}}}};
}

/// Squared distances from the vertices, and of few triangles also from the midpoints of edges and
/// the centroids: each sample once.
std::vector<double> squared_distances(const SurfaceMesh& from, const Bvh& to,
                                      const RunContext& run) {
    std::vector<std::uint8_t> is_used(from.vertices.size(), 0);
    for (const auto& triangle : from.triangles) {
        for (const Index v : triangle) {
            is_used[static_cast<std::size_t>(v)] = 1;
        }
    }
    std::vector<Index> hints(from.vertices.size(), kNone);
    std::vector<double> squared(from.vertices.size());
    for_each_index(squared.size(), run, [&](std::size_t v) {
        if (is_used[v] != 0) {
            const auto nearest = to.closest(from.vertices[v], kInfinity);
            squared[v] = nearest->distance2;
            hints[v] = nearest->triangle;
        }
    });
    std::size_t count = 0;
    for (std::size_t v = 0; v < squared.size(); ++v) {
        squared[count] = squared[v];
        count += is_used[v];
    }
    squared.resize(count);
    if (from.triangles.size() > kManyTriangles) {
        return squared;
    }

    const auto add = [&](std::size_t samples, auto sample) {
        const std::size_t first = squared.size();
        squared.resize(first + samples);
        for_each_index(samples, run, [&](std::size_t i) {
            const auto [point, near] = sample(i);
            squared[first + i] =
                to.closest(point, kInfinity, hints[static_cast<std::size_t>(near)])->distance2;
        });
    };
    const auto edges = edges_of(from.triangles);
    add(edges.size(), [&](std::size_t i) {
        const auto& [a, b] = edges[i];
        const Vec3 middle = 0.5 * (corner(from.vertices, a) + corner(from.vertices, b));
        return std::pair(middle, a);
    });
    add(from.triangles.size(), [&](std::size_t i) {
        const auto& [a, b, c] = from.triangles[i];
        const Vec3 centroid =
            (corner(from.vertices, a) + corner(from.vertices, b) + corner(from.vertices, c)) / 3.0;
        return std::pair(centroid, a);
    });
    return squared;
}

}  // namespace

SurfaceQuality measure_surface(const SurfaceMesh& surface) {
    const auto& points = surface.vertices;
    const std::size_t n = surface.triangles.size();
    std::vector<double> ratios(n);
    std::vector<double> angles(n);
    const RunContext unstoppable;
    for_each_index(n, unstoppable, [&](std::size_t i) {
        const auto& [a, b, c] = surface.triangles[i];
        ratios[i] = triangle_radius_ratio(corner(points, a), corner(points, b), corner(points, c));
        angles[i] =
            triangle_angles(corner(points, a), corner(points, b), corner(points, c)).min * kDegrees;
    });
    const auto edges = edges_of(surface.triangles);
    std::vector<double> lengths;
    lengths.reserve(edges.size());
    for (const auto& [a, b] : edges) {
        lengths.push_back((corner(points, a) - corner(points, b)).norm());
    }
    const auto [parts, used] = count_parts(points.size(), edges);
    const double longest =
        lengths.empty() ? 1.0 : *std::max_element(lengths.begin(), lengths.end());

    SurfaceQuality quality;
    quality.vertices = used;
    quality.triangles = static_cast<std::int64_t>(n);
    quality.components = parts;
    quality.euler_characteristic =
        used - static_cast<std::int64_t>(edges.size()) + quality.triangles;
    quality.area = surface_area(surface);
    quality.volume = enclosed_volume(surface);
    quality.radius_ratio = summarize(std::move(ratios), {.low = 0.0, .high = 1.0}, 20);
    quality.min_angle = summarize(std::move(angles), {.low = 0.0, .high = 60.0}, 12);
    quality.edge_length =
        summarize(std::move(lengths), {.low = 0.0, .high = longest > 0.0 ? longest : 1.0}, 20);
    return quality;
}

TetQuality measure_tets(const TetMesh& mesh) {
    const auto& points = mesh.vertices;
    const std::size_t n = mesh.tets.size();
    TetQuality quality;
    quality.tets = static_cast<std::int64_t>(n);
    quality.volume = sum_over(n, [&](std::size_t i) {
        const auto& [a, b, c, d] = mesh.tets[i];
        return tet_volume(corner(points, a), corner(points, b), corner(points, c),
                          corner(points, d));
    });
    const RunContext unstoppable;
    {
        std::vector<double> ratios(n);
        for_each_index(n, unstoppable, [&](std::size_t i) {
            const auto& [a, b, c, d] = mesh.tets[i];
            ratios[i] = tet_radius_ratio(corner(points, a), corner(points, b), corner(points, c),
                                         corner(points, d));
        });
        quality.radius_ratio = summarize(std::move(ratios), {.low = 0.0, .high = 1.0}, 20);
    }
    // Smallest and largest angle of each tet: they carry the bounds, in a third of the memory of
    // all six.
    std::vector<double> angles(2 * n);
    for_each_index(n, unstoppable, [&](std::size_t i) {
        const auto& [a, b, c, d] = mesh.tets[i];
        const auto range = dihedral_angles(corner(points, a), corner(points, b), corner(points, c),
                                           corner(points, d));
        angles[2 * i] = range.min * kDegrees;
        angles[2 * i + 1] = range.max * kDegrees;
    });
    quality.dihedral = summarize(std::move(angles), {.low = 0.0, .high = 180.0}, 36);
    quality.min_dihedral = quality.dihedral.min;
    return quality;
}

Deviation measure_deviation(const SurfaceMesh& from, const SurfaceMesh& to, const RunContext& run) {
    if (from.triangles.empty() || to.triangles.empty()) {
        return {};
    }
    const Bvh target(to.vertices, to.triangles);
    auto squared = squared_distances(from, target, run);
    Deviation deviation;
    deviation.rms = std::sqrt(sum_over(squared.size(), [&](std::size_t i) { return squared[i]; }) /
                              static_cast<double>(squared.size()));
    const auto p99 = squared.begin() + static_cast<std::ptrdiff_t>(squared.size() * 99 / 100);
    std::nth_element(squared.begin(), p99, squared.end());
    deviation.p99 = std::sqrt(*p99);
    deviation.max = std::sqrt(*std::max_element(p99, squared.end()));
    return deviation;
}

std::string to_json(const QualityReport& report) {
    nlohmann::json json{{"edge_length", report.edge_length},
                        {"input", json_of(report.input)},
                        {"before", json_of(report.before)},
                        {"after", json_of(report.after)},
                        {"output_to_input", json_of(report.output_to_input)},
                        {"input_to_output", json_of(report.input_to_output)},
                        {"volume_change", report.volume_change},
                        {"area_change", report.area_change}};
    json["tets"] = report.tets ? json_of(*report.tets) : nlohmann::json(nullptr);
    json["defects"] = nlohmann::json::array();
    for (const auto& defect : report.defects) {
        json["defects"].push_back(json_of(defect));
    }
    json["worst"] = nlohmann::json::array();
    for (const auto& element : report.worst) {
        json["worst"].push_back({{"radius_ratio", element.radius_ratio},
                                 {"min_dihedral", element.min_dihedral},
                                 {"at", json_of(element.at)}});
    }
    json["bounds"] = nlohmann::json::array();
    for (const BoundCheck& check : report.bounds) {
        json["bounds"].push_back({{"name", check.name},
                                  {"bound", check.bound},
                                  {"value", check.value},
                                  {"holds", check.holds}});
    }
    json["coarsened_from"] =
        report.coarsened_from ? nlohmann::json(*report.coarsened_from) : nlohmann::json();
    json["costs"] = nlohmann::json::array();
    for (const auto& cost : report.costs) {
        json["costs"].push_back({{"stage", stage_name(cost.stage)},
                                 {"seconds", cost.seconds},
                                 {"peak_mib", cost.peak_mib}});
    }
    return json.dump(2);
}

}  // namespace remesh
