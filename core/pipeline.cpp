#include "core/pipeline.h"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/mesh/preview.h"
#include "core/mesh/quality.h"
#include "core/parallel.h"
#include "core/stages/tetrahedralize.h"
#include "core/stages/verify.h"

namespace remesh {
namespace {

/// A surface-only run fills this many h below the surface; the body beneath is spanned by long
/// tets.
constexpr double kShellDepth = 1.5;
constexpr std::size_t kWorstElements = 10;

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

std::vector<double> sizes_at(const Points& points, const SizingField& sizing,
                             const RunContext& run) {
    std::vector<double> sizes(points.size());
    for_each_index(points.size(), run, [&](std::size_t i) { sizes[i] = sizing.h(points[i]); });
    return sizes;
}

double relative_change(double before, double after) {
    return before != 0.0 ? (after - before) / before : 0.0;
}

QualityReport make_report(PrepareResult prepared, const RemeshResult& result,
                          const RunContext& run) {
    QualityReport report;
    report.edge_length = result.edge_length;
    report.before = measure_surface(prepared.cleaned);
    report.after = measure_surface(result.surface);
    if (!result.tets.tets.empty()) {
        report.tets = measure_tets(result.tets);
        report.worst = worst_tets(result.tets);
    }
    report.output_to_input = measure_deviation(result.surface, prepared.cleaned, run);
    report.input_to_output = measure_deviation(prepared.cleaned, result.surface, run);
    report.volume_change = relative_change(prepared.facts.volume, report.after.volume);
    report.area_change = relative_change(report.before.area, report.after.area);
    report.input = std::move(prepared.facts);
    report.defects = std::move(prepared.defects);
    return report;
}

}  // namespace

RemeshResult run_pipeline(const SurfaceMesh& input, const RemeshOptions& options, RunContext& run,
                          const std::vector<double>& sizes) {
    validate(options);
    StageClock clock(run);
    RemeshResult result;
    result.edge_length = options.edge_length ? *options.edge_length : suggest_edge_length(input);
    const double h = result.edge_length;

    clock.enter(Stage::Prepare);
    auto prepared = prepare_surface(input, h, options.prepare, run);
    const Domain& domain = *prepared.domain;
    if (run.wants_preview()) {
        run.preview(decimate(domain.boundary()));
    }

    clock.enter(Stage::Features);
    const FeatureSet features = find_features(prepared, h, options.features, run);

    clock.enter(Stage::Sizing);
    const auto sizing =
        build_sizing_field(domain, features, h, options.sizing, run, {&input, sizes});

    clock.enter(Stage::Seed);
    Particles particles = seed_surface(domain, features, *sizing, options.seed, run);

    clock.enter(Stage::Relax);
    particles = relax_surface(particles, domain, features, *sizing, options.relax, run).particles;

    clock.enter(Stage::Seed);
    particles = seed_volume(particles, domain, *sizing,
                            options.tetrahedra ? std::nullopt : std::optional(kShellDepth),
                            options.seed, run);

    clock.enter(Stage::Relax);
    particles = relax_volume(particles, domain, *sizing, options.relax, run).particles;

    clock.enter(Stage::Tetrahedralize);
    auto delaunay = tetrahedralize(particles.position, run);
    for (int pass = 0; pass < options.population.passes && options.sizing.is_graded(); ++pass) {
        clock.enter(Stage::Relax);
        auto populated = control_population(particles, delaunay, domain, *sizing, run);
        particles =
            relax_volume(populated.particles, domain, *sizing, options.relax, run).particles;
        clock.enter(Stage::Tetrahedralize);
        delaunay = tetrahedralize(particles.position, run);
    }

    clock.enter(Stage::Carve);
    auto carved = carve_domain(particles, delaunay, domain, options.carve, run);
    delaunay = {};
    if (run.wants_preview()) {
        run.preview(decimate(boundary_surface(carved.mesh)));
    }

    clock.enter(Stage::Improve);
    auto improved =
        improve_mesh(carved, particles.anchor, domain, features, *sizing, options.improve, run);
    carved = {};
    particles = {};

    clock.enter(Stage::Verify);
    const Faults faults = check_tets(improved.mesh, run);
    if (faults.any()) {
        throw Error(ErrorCode::Unmeshable,
                    "no valid mesh was found at this edge length: " + faults.summary());
    }
    result.surface = boundary_surface(improved.mesh);
    if (options.sizing.return_field) {
        result.surface_sizes = sizes_at(result.surface.vertices, *sizing, run);
        result.tet_sizes = sizes_at(improved.mesh.vertices, *sizing, run);
    }
    if (options.tetrahedra) {
        result.tets = std::move(improved.mesh);
    }
    improved = {};

    clock.enter(Stage::Report);
    result.report = make_report(std::move(prepared), result, run);
    result.report.costs = clock.finish();
    return result;
}

void validate(const RemeshOptions& options) {
    if (options.edge_length &&
        !(std::isfinite(*options.edge_length) && *options.edge_length > 0.0)) {
        throw Error(ErrorCode::InvalidInput,
                    "edge_length must be > 0, got " + std::to_string(*options.edge_length));
    }
    validate(options.prepare);
    validate(options.features);
    validate(options.sizing, options.edge_length);
    validate(options.seed);
    validate(options.relax);
    validate(options.population);
    validate(options.carve);
    validate(options.improve);
}

}  // namespace remesh
