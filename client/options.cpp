#include "client/options.h"

#include <cstdint>
#include <map>
#include <string>

#include "client/flags.h"
#include "client/formats.h"
#include "client/sizing_options.h"

namespace remesh::client {
namespace {

template <typename Setter>
void add_switch(CLI::App& command, const std::string& name, const std::string& help, Setter set) {
    command.add_flag_function(
        name, [set](std::int64_t) { set(); }, help);
}

void add_file_options(CLI::App& command, JobArguments& arguments) {
    command.add_option("IN", arguments.inputs, "Surfaces to remesh; - is stdin")
        ->type_name("FILE")
        ->required();
    command
        .add_option("--format", arguments.formats,
                    "Format wanted back where no name says it, e.g. vtu, msh22 (repeatable)")
        ->type_name("FORMAT")
        ->allow_extra_args(false);
    add_value<std::string>(command, "--input-format", "FORMAT",
                           "Format of the input; found from its content if absent",
                           [&](const std::string& word) {
                               arguments.spec.mutable_input()->set_format(format_named(word));
                           });
}

void add_mesh_options(CLI::App& command, v1::JobSpec& spec) {
    v1::Options& options = *spec.mutable_options();
    command.option_defaults()->group("Mesh");
    add_value<double>(command, "--edge-length", "H", "Wanted edge length; absent: chosen",
                      [&](double x) { options.set_edge_length(x); });
    add_switch(command, "--surface-only", "No tetrahedra", [&] { options.set_tetrahedra(false); });
    add_value<std::uint64_t>(command, "--seed", "N", "Changes where particles start",
                             [&](std::uint64_t x) { options.set_seed(x); });
    v1::Frame& frame = *spec.mutable_input()->mutable_frame();
    add_choice<v1::Unit>(
        command, "--unit",
        {{"mm", v1::UNIT_MILLIMETER}, {"cm", v1::UNIT_CENTIMETER}, {"m", v1::UNIT_METER}},
        "Unit of the coordinates, carried along; scales a size image",
        [&](v1::Unit x) { frame.set_unit(x); });
    add_choice<v1::Space>(command, "--space", {{"lps", v1::SPACE_LPS}, {"ras", v1::SPACE_RAS}},
                          "Space of the coordinates, carried along; where a size image lies",
                          [&](v1::Space x) { frame.set_space(x); });
}

void add_repair_options(CLI::App& command, v1::Options& options) {
    v1::Prepare& prepare = *options.mutable_prepare();
    command.option_defaults()->group("Repair");
    add_choice<v1::Prepare::Smoothing>(command, "--smoothing",
                                       {{"auto", v1::Prepare::SMOOTHING_AUTOMATIC},
                                        {"off", v1::Prepare::SMOOTHING_OFF},
                                        {"on", v1::Prepare::SMOOTHING_ON}},
                                       "Smooth voxel stairs and noise",
                                       [&](auto x) { prepare.set_smoothing(x); });
    add_value<double>(command, "--max-displacement", "X",
                      "Largest move by smoothing, in input edges, in (0, 2]",
                      [&](double x) { prepare.set_max_displacement(x); });
    add_switch(command, "--no-close-holes", "Leave holes open",
               [&] { prepare.set_close_holes(false); });
    add_switch(command, "--keep-cavities", "Keep cavities inside the body",
               [&] { prepare.set_keep_cavities(true); });
    add_value<double>(command, "--speck-volume", "X",
                      "Drop parts below this share of the largest, in [0, 1)",
                      [&](double x) { prepare.set_speck_volume(x); });

    v1::Features& features = *options.mutable_features();
    add_switch(command, "--no-features", "Don't keep sharp edges and corners",
               [&] { features.set_detect(false); });
    add_value<double>(command, "--sharp-angle", "DEG", "Edges bent by more are sharp",
                      [&](double x) { features.set_sharp_angle(x); });
    add_value<double>(command, "--corner-angle", "DEG",
                      "Sharp lines that turn by more have a corner",
                      [&](double x) { features.set_corner_angle(x); });
    add_choice<v1::Features::Patches>(command, "--patches",
                                      {{"input", v1::Features::PATCHES_INPUT},
                                       {"faces", v1::Features::PATCHES_FACES},
                                       {"none", v1::Features::PATCHES_NONE}},
                                      "Named parts of the surface: the input's, or what lies "
                                      "between sharp edges",
                                      [&](auto x) { features.set_patches(x); });
}

void add_relaxation_options(CLI::App& command, v1::Options& options) {
    v1::Relaxation& relaxation = *options.mutable_relaxation();
    command.option_defaults()->group("Relaxation");
    add_choice<v1::Relaxation::Force>(command, "--force",
                                      {{"springs", v1::Relaxation::FORCE_SPRINGS},
                                       {"charged", v1::Relaxation::FORCE_CHARGED_PARTICLES}},
                                      "Force between particles",
                                      [&](auto x) { relaxation.set_force(x); });
    add_choice<v1::Relaxation::Integrator>(
        command, "--integrator",
        {{"damped", v1::Relaxation::INTEGRATOR_DAMPED_DYNAMICS},
         {"gradient", v1::Relaxation::INTEGRATOR_GRADIENT_DESCENT},
         {"fire", v1::Relaxation::INTEGRATOR_FIRE}},
        "Time integration", [&](auto x) { relaxation.set_integrator(x); });
    add_value<double>(command, "--mass", "M", "Mass of a particle, > 0",
                      [&](double x) { relaxation.set_mass(x); });
    add_value<double>(command, "--damping", "D", "Share of critical damping, in (0, 2]",
                      [&](double x) { relaxation.set_damping(x); });
    add_value<double>(command, "--charge-exponent", "P", "Power law of charges, in [1, 6]",
                      [&](double x) { relaxation.set_charge_exponent(x); });
    add_value<double>(command, "--preload", "X", "Lattice spacing over h, in [0.7, 1.2]",
                      [&](double x) { relaxation.set_preload(x); });
    add_value<std::int32_t>(command, "--max-surface-iterations", "N", "Bound on the surface",
                            [&](std::int32_t x) { relaxation.set_max_surface_iterations(x); });
    add_value<std::int32_t>(command, "--max-volume-iterations", "N", "Bound in the volume",
                            [&](std::int32_t x) { relaxation.set_max_volume_iterations(x); });
    add_value<std::int32_t>(command, "--population-passes", "N",
                            "Passes that insert and remove particles where sizes vary",
                            [&](std::int32_t x) { relaxation.set_population_passes(x); });
    add_value<double>(command, "--tolerance", "X", "Converged below this rms step over h",
                      [&](double x) { relaxation.set_tolerance(x); });
}

void add_improvement_options(CLI::App& command, v1::Options& options) {
    v1::Improvement& improvement = *options.mutable_improvement();
    command.option_defaults()->group("Improvement");
    add_choice<v1::Improvement::Mode>(command, "--mode",
                                      {{"balanced", v1::Improvement::MODE_BALANCED},
                                       {"strict-delaunay", v1::Improvement::MODE_STRICT_DELAUNAY},
                                       {"max-min-angle", v1::Improvement::MODE_MAX_MIN_ANGLE}},
                                      "What to aim at", [&](auto x) { improvement.set_mode(x); });
    add_value<std::int32_t>(command, "--passes", "N", "Passes of flips and smoothing",
                            [&](std::int32_t x) { improvement.set_passes(x); });
    add_value<std::int64_t>(command, "--max-tets", "N", "Coarsen until no more come out, >= 100",
                            [&](std::int64_t x) { options.set_max_tets(x); });

    command.option_defaults()->group("Bounds: a result that breaks one fails, with its report");
    v1::Bounds& bounds = *options.mutable_bounds();
    add_value<double>(command, "--min-dihedral", "DEG", "Smallest dihedral angle, in (0, 70.5]",
                      [&](double x) { bounds.set_min_dihedral(x); });
    add_value<double>(command, "--max-deviation", "D",
                      "Largest distance between the surfaces, model units",
                      [&](double x) { bounds.set_max_deviation(x); });
    add_value<double>(command, "--max-volume-change", "X", "Share of the volume, 0.01 is 1 %",
                      [&](double x) { bounds.set_max_volume_change(x); });
}

void add_queue_options(CLI::App& command, JobArguments& arguments) {
    v1::JobSpec& spec = arguments.spec;
    command.option_defaults()->group("Job");
    command.add_flag("--estimate", arguments.wants_estimate,
                     "Only check, and say what it would need");
    add_switch(command, "--skip-cache", "Run even if an equal job's result is there",
               [&] { spec.set_skip_cache(true); });
    add_value<std::int32_t>(command, "--priority", "N", "Higher goes first, in [-100, 100]",
                            [&](std::int32_t x) { spec.set_priority(x); });
    add_value<double>(command, "--time-limit", "SECONDS", "Longest time to run", [&](double x) {
        const auto milliseconds = static_cast<std::int64_t>(x * 1e3);
        spec.mutable_timeout()->set_seconds(milliseconds / 1000);
        spec.mutable_timeout()->set_nanos(static_cast<std::int32_t>(milliseconds % 1000) *
                                          1'000'000);
    })->check(CLI::Range(0.001, 1e9).description(""));
    add_value<std::vector<std::string>>(
        command, "--label", "KEY=VALUE", "Shown with the job; never patient data; repeatable",
        [&](const std::vector<std::string>& labels) {
            for (const std::string& label : labels) {
                const std::size_t equals = label.find('=');
                if (equals == std::string::npos || equals == 0) {
                    throw CLI::ValidationError("--label", "must be KEY=VALUE, got " + label);
                }
                (*spec.mutable_labels())[label.substr(0, equals)] = label.substr(equals + 1);
            }
        })
        ->allow_extra_args(false);
}

}  // namespace

void add_job_arguments(CLI::App& command, JobArguments& arguments) {
    v1::JobSpec& spec = arguments.spec;
    add_file_options(command, arguments);
    add_mesh_options(command, spec);
    add_sizing_options(command, *spec.mutable_options()->mutable_sizing());
    add_value<std::string>(command, "--size-image", "FILE",
                           "Edge lengths in mm as an image: NIfTI, NRRD or MetaImage, placed by "
                           "--space and --unit",
                           [&](const std::string& path) { arguments.size_image = path; });
    add_repair_options(command, *spec.mutable_options());
    add_relaxation_options(command, *spec.mutable_options());
    add_improvement_options(command, *spec.mutable_options());
    add_queue_options(command, arguments);
    command.option_defaults()->group("Options");
}

std::optional<InputFile> open_size_image(const JobArguments& arguments) {
    return arguments.size_image.empty() ? std::nullopt
                                        : std::optional<InputFile>(arguments.size_image);
}

}  // namespace remesh::client
