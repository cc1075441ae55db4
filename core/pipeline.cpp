#include "core/pipeline.h"

#include <sys/resource.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/mesh/preview.h"
#include "core/mesh/quality.h"
#include "core/number_text.h"
#include "core/parallel.h"
#include "core/stages/sizing/diffused_map.h"
#include "core/stages/surface_math.h"
#include "core/stages/tetrahedralize.h"
#include "core/stages/text.h"

namespace remesh {
namespace {

/// A surface-only run fills this many h below the surface; the body beneath is spanned by long
/// tets.
constexpr double kShellDepth = 1.2;
constexpr std::size_t kWorstElements = 10;
constexpr double kTetsPerVolume = 9.0;  // Of the A15 lattice, per h^3.
constexpr double kHopeless = 1.5;       // Times max_tets: not even tried.
constexpr int kMaxCoarsenings = 10;
constexpr double kCoarsenMargin = 1.02;  // Of h, as the boundary takes its share.
constexpr int kGradedIterations = 60;    // Of a relaxation of the volume where sizes vary.
constexpr int kFewestCycles = 4;         // A step goes half the way at least.
constexpr int kMostCycles = 10;          // Of a map that diffuses on the particles.
constexpr double kSpeckMargin = 0.5;     // A part kept at the door may lose this much by meshing.
constexpr double kLeastVolume = 0.5;     // Of the body's: a mesh that holds less is of no use,
constexpr double kNotableChange = 0.1;   // and a change by this share is told.
constexpr double kSettled = 0.01;        // Of the particles; no more come or go in the last cycle.

/// Enters stages and keeps what each one cost.
class StageClock {
public:
    explicit StageClock(RunContext& run) : run_(run) {}

    void enter(Stage stage) {
        close();
        run_.enter(stage);
        open_ = stage;
        start_ = cpu_seconds();
    }

    /// Ends the present stage and returns the cost of all.
    std::vector<QualityReport::StageCost> finish() {
        close();
        return std::move(costs_);
    }

private:
    static rusage usage() {
        rusage now{};
        getrusage(RUSAGE_SELF, &now);
        return now;
    }
    static double seconds(const timeval& time) {
        return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
    }
    static double cpu_seconds() {
        const rusage now = usage();
        return seconds(now.ru_utime) + seconds(now.ru_stime);
    }
    void close() {
        if (open_) {
            costs_.push_back({.stage = *open_,
                              .seconds = cpu_seconds() - start_,
                              .peak_mib = static_cast<double>(usage().ru_maxrss) / 1024.0});
            open_.reset();
        }
    }

    RunContext& run_;
    std::optional<Stage> open_{};
    double start_ = 0.0;
    std::vector<QualityReport::StageCost> costs_{};
};

std::vector<WorstElement> worst_tets(const TetMesh& mesh) {
    std::vector<std::pair<double, std::size_t>> ranked(mesh.tets.size());
    const auto corner = [&](Index v) -> const Vec3& {
        return mesh.vertices[static_cast<std::size_t>(v)];
    };
    for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
        const auto& [a, b, c, d] = mesh.tets[i];
        ranked[i] = {tet_radius_ratio(corner(a), corner(b), corner(c), corner(d)), i};
    }
    const auto end =
        ranked.begin() + static_cast<std::ptrdiff_t>(std::min(kWorstElements, ranked.size()));
    std::partial_sort(ranked.begin(), end, ranked.end());

    std::vector<WorstElement> worst;
    std::transform(ranked.begin(), end, std::back_inserter(worst), [&](const auto& entry) {
        const auto& [a, b, c, d] = mesh.tets[entry.second];
        const auto angles = dihedral_angles(corner(a), corner(b), corner(c), corner(d));
        return WorstElement{.radius_ratio = entry.first,
                            .min_dihedral = angles.min * 180.0 / std::numbers::pi,
                            .at = 0.25 * (corner(a) + corner(b) + corner(c) + corner(d))};
    });
    return worst;
}

/// Tells of what the edge length was too coarse for.
/// \throws Error{Unmeshable} if hardly anything of the body is left
void note_losses(PrepareResult& prepared, const CarveResult& carved, double volume, double h,
                 RunContext& run) {
    const auto note = [&](const char* code, const std::string& text, std::int64_t count,
                          std::optional<Vec3> at) {
        prepared.defects.push_back({.code = code, .description = text, .count = count, .at = at});
        run.warn({.code = code, .message = text, .at = at});
    };
    const double before = prepared.facts.volume;
    if (volume < kLeastVolume * before) {
        throw Error(ErrorCode::Unmeshable, "the body is too thin for edge_length " + text_of(h) +
                                               ": its mesh would hold only " +
                                               percent(volume / before) + " of its volume");
    }
    if (carved.notable_parts > 0) {
        note("LOST_PARTS",
             count_of(carved.notable_parts, "part") + " too small for edge_length " + text_of(h) +
                 " left out of the mesh",
             carved.notable_parts, carved.notable_part);
    }
    if (std::abs(volume - before) > kNotableChange * before) {
        note("VOLUME_CHANGED",
             "the mesh holds " + percent(std::abs(volume - before) / before) +
                 (volume < before ? " less" : " more") + " than the body: edge_length " +
                 text_of(h) + " is coarse for it",
             1, std::nullopt);
    }
}

std::vector<double> sizes_at(const Points& points, const SizingField& sizing,
                             const RunContext& run) {
    std::vector<double> sizes(points.size());
    for_each_index(points.size(), run, [&](std::size_t i) { sizes[i] = sizing.h(points[i]); });
    return sizes;
}

void set_patches(PatchSource source, const Domain& domain, const FeatureSet& features,
                 const ImproveResult& improved, SurfaceMesh& surface, RunContext& run) {
    switch (source) {
        case PatchSource::Input: return carry_patches(domain, surface, run);
        case PatchSource::Faces: surface.patch = number_faces(features, improved); return;
        case PatchSource::None: return;
    }
}

double relative_change(double before, double after) {
    return before != 0.0 ? (after - before) / before : 0.0;
}

QualityReport make_report(PrepareResult prepared, const RemeshResult& result,
                          const RunContext& run) {
    QualityReport report;
    report.edge_length = result.edge_length;
    tbb::parallel_invoke(
        [&] { report.before = measure_surface(prepared.cleaned); },
        [&] { report.after = measure_surface(result.surface); },
        [&] {
            if (!result.tets.tets.empty()) {
                report.tets = measure_tets(result.tets);
            }
        },
        [&] {
            if (!result.tets.tets.empty()) {
                report.worst = worst_tets(result.tets);
            }
        },
        [&] { report.output_to_input = measure_deviation(result.surface, prepared.cleaned, run); },
        [&] { report.input_to_output = measure_deviation(prepared.cleaned, result.surface, run); });
    report.volume_change = relative_change(prepared.facts.volume, report.after.volume);
    report.area_change = relative_change(report.before.area, report.after.area);
    report.input = std::move(prepared.facts);
    report.defects = std::move(prepared.defects);
    return report;
}

/// Particles at rest and their Delaunay tets.
struct Filling {
    Particles particles{};
    TetComplex delaunay{};
};

// Population control and relaxation, again and again. A map that diffuses takes a step before each,
// until hardly a particle comes or goes.
void repopulate(Filling& filling, const Domain& domain, const SizingMap& map, int passes,
                const RelaxOptions& relax, StageClock& clock, RunContext& run) {
    auto& [particles, delaunay] = filling;
    bool is_settled = false;
    for (int pass = 0; pass < passes && !is_settled; ++pass) {
        clock.enter(Stage::Relax);
        if (map.coupled) {
            map.coupled->diffuse(particles, delaunay, domain, run);
        }
        auto populated = control_population(particles, delaunay, domain, *map.field, run);
        if (map.coupled) {
            map.coupled->repopulate(populated.origin);
            const auto changed = static_cast<double>(populated.inserted + populated.removed);
            is_settled = pass + 1 >= kFewestCycles &&
                         changed < kSettled * static_cast<double>(particles.size());
        }
        particles = relax_volume(populated.particles, domain, *map.field, relax, run).particles;
        clock.enter(Stage::Tetrahedralize);
        delaunay = tetrahedralize(particles.position, run, particles.lattice);
    }
}

Filling fill(const Domain& domain, const FeatureSet& features, const SizingMap& map,
             const RemeshOptions& options, StageClock& clock, RunContext& run) {
    const SizingField& sizing = *map.field;
    RelaxOptions relax = options.relax;
    if (!relax.max_volume_iterations && options.sizing.is_graded() && !map.coupled) {
        relax.max_volume_iterations = kGradedIterations;
    }

    clock.enter(Stage::Seed);
    Particles particles = seed_surface(domain, features, sizing, options.seed, run);

    clock.enter(Stage::Relax);
    particles = relax_surface(particles, domain, features, sizing, relax, run).particles;

    clock.enter(Stage::Seed);
    particles = seed_volume(particles, domain, sizing,
                            options.tetrahedra ? std::nullopt : std::optional(kShellDepth),
                            options.seed, run);

    clock.enter(Stage::Relax);
    particles = relax_volume(particles, domain, sizing, relax, run).particles;

    clock.enter(Stage::Tetrahedralize);
    auto delaunay = tetrahedralize(particles.position, run, particles.lattice);
    Filling filling{std::move(particles), std::move(delaunay)};
    if (options.sizing.is_graded()) {
        repopulate(filling, domain, map, map.coupled ? kMostCycles : options.population.passes,
                   relax, clock, run);
    }
    return filling;
}

// The paper's steps. Nothing if more tets than max_tets would come out; `tets` says how many.
std::optional<RemeshResult> mesh_at(double h, const SurfaceMesh& input,
                                    const std::vector<double>& sizes, const RemeshOptions& options,
                                    StageClock& clock, RunContext& run, double& tets) {
    const double most = options.max_tets ? static_cast<double>(*options.max_tets)
                                         : std::numeric_limits<double>::infinity();
    RemeshResult result;
    result.edge_length = h;

    clock.enter(Stage::Prepare);
    auto prepared = prepare_surface(input, h, options.prepare, run);
    const Domain& domain = *prepared.domain;
    tets = kTetsPerVolume * std::abs(prepared.facts.volume) / (h * h * h);
    if (tets > kHopeless * most) {
        return std::nullopt;
    }
    if (run.wants_preview()) {
        run.preview(cluster(domain.boundary()));
    }

    clock.enter(Stage::Features);
    const FeatureSet features = find_features(prepared, h, options.features, run);

    clock.enter(Stage::Sizing);
    const SizingMap map =
        build_sizing_field(domain, features, h, options.sizing, run, {&input, sizes});

    auto [particles, delaunay] = fill(domain, features, map, options, clock, run);

    clock.enter(Stage::Carve);
    CarveOptions carve = options.carve;
    carve.min_part_share = kSpeckMargin * options.prepare.speck_volume;
    auto carved = carve_domain(particles, delaunay, domain, carve, run);
    delaunay = {};
    tets = static_cast<double>(carved.mesh.tets.size());
    if (tets > most) {
        return std::nullopt;
    }
    if (run.wants_preview()) {
        run.preview(cluster(boundary_surface(carved.mesh)));
    }

    clock.enter(Stage::Improve);
    auto improved = improve_mesh(carved, particles.anchor, domain, features, options.improve, run,
                                 options.tetrahedra ? Aim::Body : Aim::Surface,
                                 [&](Stage stage) { clock.enter(stage); });
    carved.mesh = {};
    carved.kind = {};
    particles = {};
    tets = static_cast<double>(improved.mesh.tets.size());
    if (tets > most) {
        return std::nullopt;
    }

    result.surface = boundary_surface(improved.mesh, std::move(improved.boundary));
    note_losses(prepared, carved, enclosed_volume(result.surface), h, run);
    set_patches(options.patches, domain, features, improved, result.surface, run);
    if (options.sizing.return_field) {
        result.surface_sizes = sizes_at(result.surface.vertices, *map.field, run);
        result.tet_sizes = sizes_at(improved.mesh.vertices, *map.field, run);
    }
    if (options.tetrahedra) {
        result.tets = std::move(improved.mesh);
    }
    improved = {};

    clock.enter(Stage::Report);
    result.report = make_report(std::move(prepared), result, run);
    result.report.bounds = check_bounds(result.report, options.bounds);
    return result;
}

}  // namespace

RemeshResult run_pipeline(const SurfaceMesh& input, const RemeshOptions& options, RunContext& run,
                          const std::vector<double>& sizes) {
    validate(options);
    StageClock clock(run);
    const double asked = options.edge_length ? *options.edge_length : suggest_edge_length(input);
    double h = asked;
    for (int attempt = 0; attempt < kMaxCoarsenings; ++attempt) {
        double tets = 0.0;
        if (auto result = mesh_at(h, input, sizes, options, clock, run, tets)) {
            if (h > asked) {
                result->report.coarsened_from = asked;
                run.warn({"COARSENED",
                          "the edge length was raised from " + text_of(asked) + " to " +
                              text_of(h) + " for at most " + std::to_string(*options.max_tets) +
                              " tets",
                          std::nullopt});
            }
            result->report.costs = clock.finish();
            return std::move(*result);
        }
        h *= kCoarsenMargin * std::cbrt(tets / static_cast<double>(*options.max_tets));
    }
    throw Error(ErrorCode::TooLarge,
                "no edge length was found at which there are at most "
                "max_tets = " +
                    std::to_string(*options.max_tets) + " tets");
}

void validate(const RemeshOptions& options) {
    if (options.edge_length &&
        !(std::isfinite(*options.edge_length) && *options.edge_length > 0.0)) {
        throw Error(ErrorCode::InvalidInput,
                    "edge_length must be > 0, got " + number_text(*options.edge_length));
    }
    validate(options.prepare);
    validate(options.features);
    validate(options.sizing, options.edge_length);
    validate(options.seed);
    validate(options.relax);
    validate(options.population);
    validate(options.carve);
    validate(options.improve);
    validate(options.bounds, options.tetrahedra);
    if (options.max_tets && (*options.max_tets < 100 || !options.tetrahedra)) {
        throw Error(ErrorCode::InvalidInput,
                    options.tetrahedra
                        ? "max_tets must be >= 100, got " + std::to_string(*options.max_tets)
                        : "max_tets must be absent in a job without tetrahedra, got " +
                              std::to_string(*options.max_tets));
    }
}

}  // namespace remesh
