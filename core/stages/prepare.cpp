#include "core/stages/prepare.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/exact/intersections.h"
#include "core/geometry/domain_volume.h"
#include "core/geometry/edge_table.h"
#include "core/geometry/surface_domain.h"
#include "core/geometry/wide_tree.h"
#include "core/geometry/winding_number.h"
#include "core/number_text.h"
#include "core/parallel.h"
#include "core/stages/clean.h"
#include "core/stages/close_holes.h"
#include "core/stages/close_pinholes.h"
#include "core/stages/fill_holes.h"
#include "core/stages/orient.h"
#include "core/stages/skin.h"
#include "core/stages/smooth_skin.h"
#include "core/stages/surface_math.h"
#include "core/stages/text.h"

namespace remesh {
namespace {

constexpr double kHoleCell = 0.6;              // Of h: cells of the grid that closes holes.
constexpr double kHoleGap = 0.25;              // Of h: patches stop so near to the skin,
constexpr double kRoughHoleGap = 0.5;          // and where the skin is rough.
constexpr double kMostVariation = 1.7;         // Of edges, sqrt(3): slices four times as thick.
constexpr double kRoughDensity = 0.85;         // Density of sharp edges from which on to smooth
constexpr double kFineEdge = 1.6;              // unless the mean edge is longer than this times h,
constexpr double kEvenEdges = 0.5;             // or edges vary less than this, as those of voxels,
constexpr std::int64_t kManyTriangles = 1000;  // and are too many for a plain part.
// Of all area, the mean of what separates in from out at all and of what does so soundly. Real
// surfaces, badly damaged ones included, were above 0.45, random triangles at 0.13.
constexpr double kLeastSkin = 0.3;
constexpr double kLeastSize = 1.0;                 // Diagonals below and
constexpr double kLargestSize = 1e4;               // above these aren't likely in millimetres.
constexpr std::size_t kMostCandidates = 300;       // Times the triangles: pairs of boxes looked at.
constexpr std::size_t kMostCrossings = 1'000'000;  // So many pairs are counted.
constexpr double kVolumeCells = 2e4;               // So many cells to the area measure a volume.
constexpr double kLeastVolume = 0.2;               // Of h^3.
constexpr double kLeastDepth = 1e-3;  // Of the diagonal, across the plane that fits best.

/// Middles and starts of the edges that an odd number of triangles have, at most `most`.
Points open_edge_points(const SurfaceMesh& surface,
                        std::int32_t most = std::numeric_limits<std::int32_t>::max()) {
    Points points;
    const EdgeTable table(surface.triangles, surface.vertices.size());
    for (const auto& edge : table.edges()) {
        if (edge.count % 2 == 1 && edge.count <= most) {
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
    if (to.patch.empty() || patches.triangles.empty()) {
        return;
    }
    // Holes are closed in two steps, as one patch after those of the input.
    auto& names = to.patch_names;
    if (names.empty() || names.back() != kClosedHoles) {
        const auto ids = *std::max_element(to.patch.begin(), to.patch.end()) + 1;
        names.resize(std::max(names.size(), static_cast<std::size_t>(ids)));
        names.emplace_back(kClosedHoles);
    }
    to.patch.resize(to.triangles.size(), static_cast<std::int32_t>(names.size()) - 1);
}

/// Sorts triangles so that neighbours in space are neighbours in memory, and vertices by their
/// first use; unused ones go.
void sort_in_space(SurfaceMesh& surface) {
    const auto order = build_wide_tree(surface.vertices, surface.triangles).order;
    std::vector<Triangle> triangles;
    std::vector<std::int32_t> patch;
    triangles.reserve(order.size());
    for (const Index i : order) {
        triangles.push_back(surface.triangles[static_cast<std::size_t>(i)]);
        if (!surface.patch.empty()) {
            patch.push_back(surface.patch[static_cast<std::size_t>(i)]);
        }
    }
    surface.triangles = std::move(triangles);
    surface.patch = std::move(patch);
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
    // An apex amid the area, so that gaps count for little.
    std::vector<std::size_t> all(surface.triangles.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    const Vec3 apex = center_of_area(surface, all);
    return sum_over(surface.triangles.size(),
                    [&](std::size_t i) { return cone_volume(surface, i, apex); });
}

/// The steps of one call.
class Preparation {
public:
    Preparation(double h, const PrepareOptions& options, RunContext& run)
        : h_(h), options_(options), run_(run) {}

    PrepareResult prepare(const SurfaceMesh& input) {
        clean(input);
        require_depth();
        run_.report(0.1);
        orient();
        run_.report(0.25);
        SurfaceMesh whole = result_.cleaned;
        WindingNumber winding(whole.vertices, whole.triangles);
        if (options_.close_holes && result_.facts.boundary_edges > 0) {
            close_rims(whole, winding);
        }
        take_skin(whole, winding);
        run_.report(0.45);
        if (options_.close_holes) {
            close(whole, winding);
        }
        sort_in_space(skin_);
        run_.report(0.6);
        require_body();
        Points normals;
        if (wants_smoothing()) {
            normals = smooth(winding);
        }
        run_.report(0.95);
        if (!result_.domain || result_.smoothed) {
            result_.domain = std::make_shared<SurfaceDomain>(std::move(skin_), std::move(normals));
        }
        for (const Defect& defect : result_.defects) {
            run_.warn({.code = defect.code, .message = defect.description, .at = defect.at});
        }
        run_.report(1.0);
        return std::move(result_);
    }

private:
    void note(std::string code, std::string text, std::int64_t count,
              std::optional<Vec3> at = std::nullopt) {
        result_.defects.push_back(
            {.code = std::move(code), .description = std::move(text), .count = count, .at = at});
    }

    void add_defects(std::vector<Defect> defects) {
        std::move(defects.begin(), defects.end(), std::back_inserter(result_.defects));
    }

    void clean(const SurfaceMesh& input) {
        auto cleaned = clean_surface(input, h_, run_);
        result_.facts = cleaned.facts;
        add_defects(std::move(cleaned.defects));
        result_.cleaned = std::move(cleaned.surface);
        const auto& facts = result_.facts;
        if (facts.non_manifold_edges > 0) {
            note("NON_MANIFOLD_EDGES",
                 count_of(facts.non_manifold_edges, "edge") + " with more than two triangles",
                 facts.non_manifold_edges, cleaned.first_non_manifold);
        }
        note_units();
        note_crossings();
    }

    void note_units() {
        const double size = result_.facts.bounds.diagonal();
        if (size < kLeastSize || size > kLargestSize) {
            note("UNITS",
                 "the model is " + text_of(size) + " across: in millimetres that is " +
                     (size < kLeastSize ? "less than any organ, maybe these are metres"
                                        : "more than any body, maybe these are micrometres") +
                     "; lengths are taken as they are",
                 1);
        }
    }

    void note_crossings() {
        const auto& surface = result_.cleaned;
        const auto crossings =
            find_crossings(surface.vertices, surface.triangles,
                           {.only_apart = true,
                            .pairs = kMostCrossings,
                            .candidates = kMostCandidates * surface.triangles.size()},
                           [this] { run_.checkpoint(); });
        const auto& pairs = crossings.pairs;
        if (!crossings.is_complete) {
            note("SELF_INTERSECTIONS", "too many pairs of triangles that cross to be counted",
                 static_cast<std::int64_t>(kMostCrossings));
        } else if (!pairs.empty()) {
            note("SELF_INTERSECTIONS",
                 count_of(static_cast<std::int64_t>(pairs.size()), "pair") +
                     " of triangles that cross; the winding number decided what lies inside",
                 static_cast<std::int64_t>(pairs.size()),
                 centroid(surface, static_cast<std::size_t>(pairs[0].first)));
        }
    }

    // Triangles in one plane hold nothing, though a sheet that folds back on itself may pass for
    // the skin of a body.
    void require_depth() {
        const Points& points = result_.cleaned.vertices;
        Vec3 mean = Vec3::Zero();
        for (const Vec3& point : points) {
            mean += point / static_cast<double>(points.size());
        }
        Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
        for (const Vec3& point : points) {
            spread += (point - mean) * (point - mean).transpose();
        }
        const Vec3 normal =
            Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
        double low = 0.0;
        double high = 0.0;
        for (const Vec3& point : points) {
            const double height = (point - mean).dot(normal);
            low = std::min(low, height);
            high = std::max(high, height);
        }
        if (high - low < kLeastDepth * bounding_box(points).diagonal()) {
            throw Error(ErrorCode::Unmeshable,
                        "the triangles lie in one plane: they enclose no body");
        }
    }

    void orient() {
        auto oriented = orient_surface(result_.cleaned, h_, options_, run_);
        result_.cleaned = std::move(oriented.surface);
        add_defects(std::move(oriented.defects));
    }

    /// Adds what wide holes and pinholes lack, so that all that is decided by w is right.
    void close_rims(SurfaceMesh& whole, WindingNumber& winding) {
        filled_ = fill_wide_holes(whole, winding, {.h = h_, .is_rough = wants_smoothing()}, run_);
        pinholes_ = close_pinholes(result_.cleaned, h_, run_);
        if (wants_smoothing()) {
            SurfaceMesh spanned = result_.cleaned;
            add_pinholes(spanned);
            rim_points_ = open_edge_points(spanned, 1);
        }
        append(whole, filled_.patches);
        add_pinholes(whole);
        if (filled_.filled > 0 || pinholes_.closed > 0) {
            winding = WindingNumber(whole.vertices, whole.triangles);
        }
    }

    /// Their triangles lie between vertices of the cleaned surface, which come first.
    void add_pinholes(SurfaceMesh& surface) const {
        const auto& added = pinholes_.triangles;
        surface.triangles.insert(surface.triangles.end(), added.begin(), added.end());
        surface.patch.insert(surface.patch.end(), pinholes_.patch.begin(), pinholes_.patch.end());
    }

    void take_skin(const SurfaceMesh& whole, const WindingNumber& winding) {
        auto skin = find_skin(whole, winding, h_, run_);
        const double area = skin.area + skin.dropped_area;
        if (0.5 * (skin.area + skin.sound_area) < kLeastSkin * area) {
            throw Error(ErrorCode::Unmeshable,
                        "the triangles enclose no body: only " + percent(skin.area / area) +
                            " of their area has an inside on one side and an outside on the other");
        }
        if (skin.dropped > 0) {
            note("INNER_SHEETS",
                 count_of(skin.dropped, "triangle") + " (" + percent(skin.dropped_area / area) +
                     " of the area) that don't separate inside from outside left out",
                 skin.dropped, skin.first_dropped);
        }
        is_closed_ = skin.dropped_area == 0.0 &&
                     (result_.facts.boundary_edges == 0 || pinholes_.is_watertight);
        skin_ = std::move(skin.surface);
    }

    void close(SurfaceMesh& whole, WindingNumber& winding) {
        // What the skin test left of a rough surface is open all over: only the input's own rims
        // count there.
        const bool is_rough = wants_smoothing();
        const Points seeds = is_rough ? rim_points_ : open_edge_points(skin_);
        const auto holes = close_holes(
            winding, skin_, seeds,
            {.cell = kHoleCell * h_, .gap = (is_rough ? kRoughHoleGap : kHoleGap) * h_}, run_);
        const auto& facts = result_.facts;
        if (facts.boundary_edges > 0) {
            const double area = pinholes_.area + filled_.area + holes.area;
            const auto patches = pinholes_.triangles.size() + filled_.patches.triangles.size() +
                                 holes.patches.triangles.size();
            const auto& narrow = holes.largest ? holes.largest : pinholes_.largest;
            note("OPEN_BOUNDARY",
                 count_of(facts.boundary_loops, "open rim") + " with " +
                     count_of(facts.boundary_edges, "edge") + " closed by " +
                     count_of(static_cast<std::int64_t>(patches), "triangle") + " (" +
                     percent(area / (area + facts.area)) + " of the area), " +
                     std::to_string(filled_.filled) + " wide ones by going on smoothly",
                 facts.boundary_loops, filled_.largest ? filled_.largest : narrow);
        }
        append(skin_, holes.patches);
        if (is_rough && !holes.patches.triangles.empty()) {
            // Smoothing needs a field that has a slope there, too.
            append(whole, holes.patches);
            winding = WindingNumber(whole.vertices, whole.triangles);
        }
    }

    void require_body() {
        if (is_closed_) {
            result_.facts.volume = volume_of(skin_);
        } else {  // Gaps between skin and patches are narrow, but far from an apex they count.
            const double cell = std::max(0.5 * h_, std::sqrt(result_.facts.area / kVolumeCells));
            result_.domain = std::make_shared<SurfaceDomain>(skin_, Points());
            result_.facts.volume = volume_inside(*result_.domain, cell, run_);
        }
        if (!(result_.facts.volume > kLeastVolume * h_ * h_ * h_)) {
            throw Error(ErrorCode::Unmeshable, "the triangles enclose no body that edge_length " +
                                                   text_of(h_) + " can resolve: their volume is " +
                                                   text_of(result_.facts.volume));
        }
    }

    [[nodiscard]] bool is_rough() const {
        const auto& facts = result_.facts;
        return facts.sharp_edge_density > kRoughDensity && facts.mean_edge < kFineEdge * h_;
    }

    /// Stairs of voxels larger than h: h resolves them, but they aren't the body's.
    [[nodiscard]] bool has_coarse_stairs() const {
        const auto& facts = result_.facts;
        const double density = facts.sharp_edge_density * facts.mean_edge / h_;
        return !is_rough() && facts.mean_edge > h_ && density > kRoughDensity &&
               facts.edge_variation < kEvenEdges && facts.triangles >= kManyTriangles;
    }

    [[nodiscard]] bool wants_smoothing() const {
        return options_.smoothing == Smoothing::On ||
               (options_.smoothing == Smoothing::Automatic && (is_rough() || has_coarse_stairs()));
    }

    Points smooth(const WindingNumber& winding) {
        const double mean_edge = result_.facts.mean_edge;
        const double variation = std::min(result_.facts.edge_variation, kMostVariation);
        const double detail = has_coarse_stairs() ? mean_edge : h_;
        auto smoothed =
            smooth_skin(std::move(skin_), winding,
                        {.h = h_,
                         .mean_edge = mean_edge,
                         .detail = detail,
                         // The mean edge by length: thick slices have a few long edges each.
                         .stairs = mean_edge * (1.0 + variation * variation),
                         .reach = options_.max_displacement * std::min(mean_edge, detail)},
                        run_);
        skin_ = std::move(smoothed.surface);
        result_.smoothed = true;
        result_.noisy = smoothed.noisy;
        result_.max_displacement = smoothed.max_displacement;
        note(smoothed.noisy ? "NOISY" : "STAIRCASE_SMOOTHED",
             "surface smoothed, vertices moved by " + text_of(smoothed.mean_displacement) +
                 " on average and " + text_of(smoothed.max_displacement) + " at most",
             static_cast<std::int64_t>(skin_.vertices.size()) - smoothed.unmoved);
        if (smoothed.parts_kept_raw > 0) {
            note("NOT_SMOOTHED",
                 count_of(smoothed.parts_kept_raw, "part") +
                     " left as they were, since smoothing would change the volume by over 2 %",
                 smoothed.parts_kept_raw);
        }
        return std::move(smoothed.normals);
    }

    double h_;
    const PrepareOptions& options_;
    RunContext& run_;
    PinholeResult pinholes_;
    FillResult filled_;
    Points rim_points_;  // Of what pinholes leave open, where the surface is rough.
    bool is_closed_ = false;
    SurfaceMesh skin_;
    PrepareResult result_;
};

void require(bool ok, const std::string& field, const std::string& range, double value) {
    if (!ok) {
        throw Error(ErrorCode::InvalidInput,
                    "prepare." + field + " must be in " + range + ", got " + number_text(value));
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
                    "edge_length must be greater than 0, got " + number_text(h));
    }
    return Preparation(h, options, run).prepare(input);
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
