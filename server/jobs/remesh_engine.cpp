#include "server/jobs/remesh_engine.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>

#include "core/error.h"
#include "core/mesh/preview.h"
#include "server/report/page.h"
#include "server/version.h"

namespace remesh {
namespace {

// A browser can cut and turn this many in an instant.
constexpr std::size_t kMaxViewedTets = 500'000;
constexpr std::size_t kMaxViewedTriangles = 200'000;

/// The problem in a validation's sentence, whose first word is the field.
void collect(std::vector<FieldProblem>& problems, const std::function<void()>& validation) {
    try {
        validation();
    } catch (const Error& error) {
        const std::string message = error.what();
        const std::string field = message.substr(0, message.find(' '));
        const bool is_known = std::any_of(problems.begin(), problems.end(),
                                          [&](const auto& other) { return other.field == field; });
        if (!is_known) {
            problems.push_back({field, message});
        }
    }
}

bool wants_tets(const OutputRequest& output, const RemeshOptions& options) {
    switch (output.content) {
        case OutputContent::Surface: return false;
        case OutputContent::Tetrahedra: return true;
        case OutputContent::Automatic: break;
    }
    return options.tetrahedra && can_write_tets(output.format);
}

void check_output(std::vector<FieldProblem>& problems, const OutputRequest& output,
                  const RemeshOptions& options, std::size_t index) {
    const std::string field = "outputs[" + std::to_string(index) + "]";
    const std::string name(format_name(output.format));
    if (wants_tets(output, options)) {
        if (!options.tetrahedra) {
            problems.push_back({field + ".content",
                                field + ".content must not be TETRAHEDRA for a surface-only job"});
        } else if (!can_write_tets(output.format)) {
            problems.push_back({field + ".format",
                                field + ".format must be one that holds tetrahedra, got " + name});
        }
    } else if (!can_write_surface(output.format)) {
        problems.push_back(
            {field + ".format", field + ".format must be one that holds a surface, got " + name});
    }
}

/// "aorta" for "aorta.stl.gz".
std::string stem_of(const std::string& file_name) {
    std::string stem =
        file_name.ends_with(".gz") ? file_name.substr(0, file_name.size() - 3) : file_name;
    if (format_of_name(stem)) {
        stem.resize(stem.rfind('.'));
    }
    return stem.empty() ? "result" : stem;
}

ReadResult read_input(const JobRequest& request, std::string_view input) {
    const std::string hint = request.input_format
                                 ? std::string(format_extension(*request.input_format))
                                 : request.file_name;
    return read_surface(input, hint, {}, request.options.sizing.vertex_field);
}

/// The request's options, with what they need of other files.
RemeshOptions read_options(const JobRequest& request, const JobFiles& inputs) {
    RemeshOptions options = request.options;
    if (request.size_image) {
        options.sizing.image = std::make_shared<SizeImage>(read_size_image(
            inputs.size_image, request.size_image->format, request.size_image->frame));
    }
    return options;
}

/// One that was written already, so that nobody has to write it again.
std::optional<ArtifactId> find_output(const JobResult& result, OutputKind kind, MeshFormat format) {
    const auto found = std::find_if(
        result.outputs.begin(), result.outputs.end(),
        [&](const JobOutput& output) { return output.kind == kind && output.format == format; });
    return found != result.outputs.end() ? std::optional(found->artifact) : std::nullopt;
}

std::string elements_of(const RunEstimate& estimate) {
    return estimate.tets > 0 ? std::to_string(estimate.tets) + " tets"
                             : std::to_string(estimate.triangles) + " triangles";
}

void require_memory(const RunEstimate& estimate, std::optional<std::int64_t> max_bytes) {
    if (max_bytes && estimate.memory_bytes > *max_bytes) {
        throw Error(ErrorCode::TooLarge,
                    "the job needs about " + std::to_string(estimate.memory_bytes >> 20U) +
                        " MiB for about " + elements_of(estimate) +
                        ", more than the server's limit of " + std::to_string(*max_bytes >> 20U) +
                        " MiB; a larger edge_length needs less");
    }
}

}  // namespace

std::vector<FieldProblem> RemeshEngine::check(const JobRequest& request) const {
    std::vector<FieldProblem> problems;
    const RemeshOptions& options = request.options;
    // Each stage names its first problem, so that one answer tells more than one.
    collect(problems, [&] { validate(options); });
    collect(problems, [&] { validate(options.prepare); });
    collect(problems, [&] { validate(options.features); });
    collect(problems, [&] { validate(options.seed); });
    collect(problems, [&] { validate(options.sizing, options.edge_length); });
    collect(problems, [&] { validate(options.relax); });
    collect(problems, [&] { validate(options.population); });
    collect(problems, [&] { validate(options.carve); });
    collect(problems, [&] { validate(options.improve); });
    collect(problems, [&] { validate(options.bounds, options.tetrahedra); });
    for (std::size_t i = 0; i < request.outputs.size(); ++i) {
        check_output(problems, request.outputs[i], options, i);
    }
    return problems;
}

JobEstimate RemeshEngine::estimate(const JobRequest& request, const JobFiles& inputs) const {
    return estimate_run(read_input(request, inputs.surface).mesh, read_options(request, inputs));
}

JobResult RemeshEngine::run(const JobRequest& request, const JobFiles& inputs, RunContext& run,
                            OutputSink& outputs) const {
    run.enter(Stage::Read);
    ReadResult read = read_input(request, inputs.surface);
    RemeshOptions options = read_options(request, inputs);
    require_memory(estimate_run(read.mesh, options), max_job_bytes_);
    for (std::string& warning : read.warnings) {
        run.warn({"INPUT_FILE", std::move(warning), std::nullopt});
    }
    RemeshResult mesh = run_pipeline(read.mesh, options, run, read.sizes);
    options.sizing.image.reset();  // It is large.

    run.enter(Stage::Write);
    JobResult result;
    result.options = request.options;
    result.options.edge_length = mesh.edge_length;
    result.broken_bounds = broken_bounds(mesh.report.bounds);
    const std::string stem = stem_of(request.file_name);
    for (const OutputRequest& wanted : request.outputs) {
        const bool is_tets = wants_tets(wanted, request.options);
        const ArtifactId artifact = outputs.add([&](std::ostream& out) {
            is_tets ? write_tets(mesh.tets, wanted.format, out, mesh.tet_sizes, mesh.surface)
                    : write_surface(mesh.surface, wanted.format, out, mesh.surface_sizes);
        });
        result.outputs.push_back({is_tets ? OutputKind::Tetrahedra : OutputKind::Surface,
                                  wanted.format, artifact,
                                  stem + std::string(format_extension(wanted.format))});
        run.report(static_cast<double>(result.outputs.size()) /
                   static_cast<double>(request.outputs.size() + 4));
    }
    add_views(request, read.mesh, mesh, run, outputs, result);
    run.report(1.0);
    result.report = std::move(mesh.report);
    return result;
}

void RemeshEngine::add_views(const JobRequest& request, const SurfaceMesh& input,
                             const RemeshResult& mesh, const RunContext& run, OutputSink& outputs,
                             JobResult& result) const {
    const auto report = outputs.add([&](std::ostream& out) { out << to_json(mesh.report); });
    result.outputs.push_back({OutputKind::Report, std::nullopt, report, "quality.json"});
    const bool is_small = mesh.surface.triangles.size() <= kMaxViewedTriangles;
    const auto surface =
        is_small ? find_output(result, OutputKind::Surface, MeshFormat::Ply) : std::nullopt;
    const auto preview = surface ? *surface : outputs.add([&](std::ostream& out) {
        write_preview(decimate(mesh.surface, kMaxViewedTriangles), out);
    });
    result.outputs.push_back({OutputKind::Preview, MeshFormat::Ply, preview, "preview.ply"});
    if (!mesh.tets.tets.empty() && mesh.tets.tets.size() <= kMaxViewedTets) {
        const auto written = find_output(result, OutputKind::Tetrahedra, MeshFormat::Vtu);
        const auto tets = written ? *written : outputs.add([&](std::ostream& out) {
            write_tets(mesh.tets, MeshFormat::Vtu, out);
        });
        result.outputs.push_back(
            {OutputKind::PreviewTetrahedra, MeshFormat::Vtu, tets, "preview.vtu"});
    }
    const std::vector<OptionRow> options =
        describe_ ? describe_(result.options) : std::vector<OptionRow>{};
    const auto page = outputs.add([&](std::ostream& out) {
        report::write_page({.request = request,
                            .input = input,
                            .result = mesh,
                            .samples = run.samples(),
                            .files = result.outputs,
                            .options = options,
                            .engine_version = kVersion,
                            .made = system_now()},
                           out);
    });
    result.outputs.push_back({OutputKind::ReportPage, std::nullopt, page, "report.html"});
}

void RemeshEngine::write_preview(const SurfaceMesh& surface, std::ostream& out) const {
    write_surface(surface, MeshFormat::Ply, out);
}

}  // namespace remesh
