#include "core/stages/prepare.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/geometry/edge_table.h"
#include "core/geometry/surface_domain.h"
#include "core/geometry/winding_number.h"
#include "core/parallel.h"
#include "core/stages/clean.h"
#include "core/stages/close_holes.h"
#include "core/stages/orient.h"
#include "core/stages/skin.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr double kHoleCell = 0.6;     // Of h: cells of the grid that closes holes.
constexpr double kHoleGap = 0.25;     // Of h: patches stop so near to the skin.
constexpr double kSoundShare = 0.5;   // Of all area: less, and there is no inside to speak of.
constexpr double kLeastVolume = 0.2;  // Of h^3.

/// Middles and starts of the edges that only one triangle (or any odd number) has.
Points open_edge_points(const SurfaceMesh& surface) {
    Points points;
    const EdgeTable table(surface.triangles, surface.vertices.size());
    for (const auto& edge : table.edges()) {
        if (edge.count % 2 == 1) {
            const Vec3& a = surface.vertices[static_cast<std::size_t>(edge.low)];
            const Vec3& b = surface.vertices[static_cast<std::size_t>(edge.high)];
            points.push_back(0.5 * (a + b));
            points.push_back(a);
        }
    }
    return points;
}

void append(SurfaceMesh& to, const SurfaceMesh& patches) {
    const auto shift = static_cast<Index>(to.vertices.size());
    to.vertices.insert(to.vertices.end(), patches.vertices.begin(), patches.vertices.end());
    for (const Triangle& t : patches.triangles) {
        to.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
    }
    if (!to.patch.empty() && !patches.triangles.empty()) {
        const auto id = *std::max_element(to.patch.begin(), to.patch.end()) + 1;
        to.patch.resize(to.triangles.size(), id);
        if (!to.patch_names.empty()) {
            to.patch_names.resize(static_cast<std::size_t>(id));
            to.patch_names.emplace_back("closed holes");
        }
    }
}

void drop_unused_vertices(SurfaceMesh& surface) {
    std::vector<Index> renamed(surface.vertices.size(), kNone);
    Points used;
    used.reserve(surface.vertices.size());
    for (auto& t : surface.triangles) {
        for (auto& v : t) {
            auto& name = renamed[static_cast<std::size_t>(v)];
            if (name == kNone) {
                name = static_cast<Index>(used.size());
                used.push_back(surface.vertices[static_cast<std::size_t>(v)]);
            }
            v = name;
        }
    }
    surface.vertices = std::move(used);
}

double volume_of(const SurfaceMesh& surface) {
    const Vec3 apex = surface.vertices.front();
    return sum_over(surface.triangles.size(),
                    [&](std::size_t i) { return cone_volume(surface, i, apex); });
}

void require(bool ok, const std::string& field, const std::string& range, double value) {
    if (!ok) {
        throw Error(ErrorCode::InvalidInput,
                    "prepare." + field + " must be in " + range + ", got " + std::to_string(value));
    }
}

}  // namespace

void validate(const PrepareOptions& options) {
    require(options.max_displacement > 0.0 && options.max_displacement <= 2.0, "max_displacement",
            "(0, 2]", options.max_displacement);
    require(options.speck_volume >= 0.0 && options.speck_volume < 1.0, "speck_volume", "[0, 1)",
            options.speck_volume);
}

PrepareResult prepare_surface(const SurfaceMesh& input, double h, const PrepareOptions& options,
                              RunContext& run) {
    validate(options);
    if (!(h > 0.0) || !std::isfinite(h)) {
        throw Error(ErrorCode::InvalidInput,
                    "edge_length must be greater than 0, got " + std::to_string(h));
    }
    PrepareResult result;
    auto cleaned = clean_surface(input, h, run);
    result.facts = cleaned.facts;
    result.defects = std::move(cleaned.defects);
    run.report(0.1);

    auto oriented = orient_surface(cleaned.surface, h, options, run);
    result.cleaned = std::move(oriented.surface);
    std::move(oriented.defects.begin(), oriented.defects.end(), std::back_inserter(result.defects));
    run.report(0.25);

    const WindingNumber winding(result.cleaned.vertices, result.cleaned.triangles);
    auto skin = find_skin(result.cleaned, winding, h, run);
    run.report(0.5);
    if (skin.surface.triangles.empty()) {
        throw Error(ErrorCode::Unmeshable, "the surface encloses no body");
    }
    SurfaceMesh surface = std::move(skin.surface);
    if (options.close_holes) {
        const auto holes = close_holes(winding, surface, open_edge_points(surface),
                                       {.cell = kHoleCell * h, .gap = kHoleGap * h}, run);
        append(surface, holes.patches);
    }
    drop_unused_vertices(surface);
    result.facts.volume = volume_of(surface);
    run.report(0.7);
    if (result.facts.volume < kLeastVolume * h * h * h) {
        throw Error(ErrorCode::Unmeshable, "the surface encloses no body");
    }
    result.domain = std::make_shared<SurfaceDomain>(std::move(surface));
    run.report(1.0);
    return result;
}

double suggest_edge_length(const SurfaceMesh& input) {
    RunContext quiet;
    const auto cleaned = clean_surface(input, 1.0, quiet);
    const auto oriented = orient_surface(cleaned.surface, cleaned.facts.mean_edge, {}, quiet);
    const SurfaceMesh& surface = oriented.surface;
    double weighted = 0.0;
    for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
        double mean = 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
            mean += (corner(surface, i, k) - corner(surface, i, (k + 1) % 3)).norm() / 3.0;
        }
        weighted += mean * area_vector(surface, i).norm();
    }
    const double area = cleaned.facts.area;
    const double volume = std::abs(volume_of(surface));
    double h = weighted / area;
    const double thickness = 3.0 * volume / area;
    if (thickness > 1e-3 * std::sqrt(area)) {
        h = std::clamp(h, thickness / 60.0, thickness / 2.0);
        // A regular mesh has about 6 sqrt(2) tets per h^3.
        constexpr double kTetsPerCube = 8.485;
        constexpr double kMaxTets = 2e6;
        h = std::max(h, std::cbrt(kTetsPerCube * volume / kMaxTets));
    }
    return h;
}

}  // namespace remesh
