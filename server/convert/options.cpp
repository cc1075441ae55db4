#include "server/convert.h"
#include "server/convert/sizing.h"

namespace remesh {
namespace {

Smoothing to_core(v1::Prepare::Smoothing smoothing, Smoothing otherwise) {
    switch (smoothing) {
        case v1::Prepare::SMOOTHING_AUTOMATIC: return Smoothing::Automatic;
        case v1::Prepare::SMOOTHING_OFF: return Smoothing::Off;
        case v1::Prepare::SMOOTHING_ON: return Smoothing::On;
        default: return otherwise;
    }
}

v1::Prepare::Smoothing to_proto(Smoothing smoothing) {
    switch (smoothing) {
        case Smoothing::Automatic: return v1::Prepare::SMOOTHING_AUTOMATIC;
        case Smoothing::Off: return v1::Prepare::SMOOTHING_OFF;
        case Smoothing::On: return v1::Prepare::SMOOTHING_ON;
    }
    return v1::Prepare::SMOOTHING_UNSPECIFIED;
}

ForceLaw to_core(v1::Relaxation::Force force, ForceLaw otherwise) {
    switch (force) {
        case v1::Relaxation::FORCE_SPRINGS: return ForceLaw::Springs;
        case v1::Relaxation::FORCE_CHARGED_PARTICLES: return ForceLaw::ChargedParticles;
        default: return otherwise;
    }
}

v1::Relaxation::Force to_proto(ForceLaw force) {
    switch (force) {
        case ForceLaw::Springs: return v1::Relaxation::FORCE_SPRINGS;
        case ForceLaw::ChargedParticles: return v1::Relaxation::FORCE_CHARGED_PARTICLES;
    }
    return v1::Relaxation::FORCE_UNSPECIFIED;
}

Integrator to_core(v1::Relaxation::Integrator integrator, Integrator otherwise) {
    switch (integrator) {
        case v1::Relaxation::INTEGRATOR_DAMPED_DYNAMICS: return Integrator::DampedDynamics;
        case v1::Relaxation::INTEGRATOR_GRADIENT_DESCENT: return Integrator::GradientDescent;
        case v1::Relaxation::INTEGRATOR_FIRE: return Integrator::Fire;
        default: return otherwise;
    }
}

v1::Relaxation::Integrator to_proto(Integrator integrator) {
    switch (integrator) {
        case Integrator::DampedDynamics: return v1::Relaxation::INTEGRATOR_DAMPED_DYNAMICS;
        case Integrator::GradientDescent: return v1::Relaxation::INTEGRATOR_GRADIENT_DESCENT;
        case Integrator::Fire: return v1::Relaxation::INTEGRATOR_FIRE;
    }
    return v1::Relaxation::INTEGRATOR_UNSPECIFIED;
}

ImproveMode to_core(v1::Improvement::Mode mode, ImproveMode otherwise) {
    switch (mode) {
        case v1::Improvement::MODE_BALANCED: return ImproveMode::Balanced;
        case v1::Improvement::MODE_STRICT_DELAUNAY: return ImproveMode::StrictDelaunay;
        case v1::Improvement::MODE_MAX_MIN_ANGLE: return ImproveMode::MaxMinAngle;
        default: return otherwise;
    }
}

v1::Improvement::Mode to_proto(ImproveMode mode) {
    switch (mode) {
        case ImproveMode::Balanced: return v1::Improvement::MODE_BALANCED;
        case ImproveMode::StrictDelaunay: return v1::Improvement::MODE_STRICT_DELAUNAY;
        case ImproveMode::MaxMinAngle: return v1::Improvement::MODE_MAX_MIN_ANGLE;
    }
    return v1::Improvement::MODE_UNSPECIFIED;
}

PatchSource to_core(v1::Features::Patches patches, PatchSource otherwise) {
    switch (patches) {
        case v1::Features::PATCHES_INPUT: return PatchSource::Input;
        case v1::Features::PATCHES_FACES: return PatchSource::Faces;
        case v1::Features::PATCHES_NONE: return PatchSource::None;
        default: return otherwise;
    }
}

v1::Features::Patches to_proto(PatchSource source) {
    switch (source) {
        case PatchSource::Input: return v1::Features::PATCHES_INPUT;
        case PatchSource::Faces: return v1::Features::PATCHES_FACES;
        case PatchSource::None: return v1::Features::PATCHES_NONE;
    }
    return v1::Features::PATCHES_UNSPECIFIED;
}

void read(const v1::Prepare& from, PrepareOptions& to) {
    to.close_holes = from.has_close_holes() ? from.close_holes() : to.close_holes;
    to.smoothing = to_core(from.smoothing(), to.smoothing);
    to.max_displacement =
        from.has_max_displacement() ? from.max_displacement() : to.max_displacement;
    to.speck_volume = from.has_speck_volume() ? from.speck_volume() : to.speck_volume;
    to.keep_cavities = from.has_keep_cavities() ? from.keep_cavities() : to.keep_cavities;
}

void read(const v1::Features& from, FeatureOptions& to) {
    to.detect = from.has_detect() ? from.detect() : to.detect;
    to.sharp_angle = from.has_sharp_angle() ? from.sharp_angle() : to.sharp_angle;
    to.corner_angle = from.has_corner_angle() ? from.corner_angle() : to.corner_angle;
}

void read(const v1::Relaxation& from, RelaxOptions& to) {
    to.force = to_core(from.force(), to.force);
    to.integrator = to_core(from.integrator(), to.integrator);
    to.mass = from.has_mass() ? from.mass() : to.mass;
    to.damping = from.has_damping() ? from.damping() : to.damping;
    to.charge_exponent = from.has_charge_exponent() ? from.charge_exponent() : to.charge_exponent;
    to.max_surface_iterations = from.has_max_surface_iterations() ? from.max_surface_iterations()
                                                                  : to.max_surface_iterations;
    if (from.has_max_volume_iterations()) {
        to.max_volume_iterations = from.max_volume_iterations();
    }
    to.tolerance = from.has_tolerance() ? from.tolerance() : to.tolerance;
}

void read(const v1::Improvement& from, ImproveOptions& to) {
    to.mode = to_core(from.mode(), to.mode);
    to.passes = from.has_passes() ? from.passes() : to.passes;
}

void read(const v1::Bounds& from, BoundOptions& to) {
    if (from.has_min_dihedral()) {
        to.min_dihedral = from.min_dihedral();
    }
    if (from.has_max_deviation()) {
        to.max_deviation = from.max_deviation();
    }
    if (from.has_max_volume_change()) {
        to.max_volume_change = from.max_volume_change();
    }
}

void write(const BoundOptions& from, v1::Bounds& to) {
    if (from.min_dihedral) {
        to.set_min_dihedral(*from.min_dihedral);
    }
    if (from.max_deviation) {
        to.set_max_deviation(*from.max_deviation);
    }
    if (from.max_volume_change) {
        to.set_max_volume_change(*from.max_volume_change);
    }
}

}  // namespace

RemeshOptions to_core(const v1::Options& from) {
    RemeshOptions to;
    if (from.has_edge_length()) {
        to.edge_length = from.edge_length();
    }
    to.tetrahedra = from.has_tetrahedra() ? from.tetrahedra() : to.tetrahedra;
    to.seed.seed = from.has_seed() ? from.seed() : to.seed.seed;
    read(from.prepare(), to.prepare);
    read(from.features(), to.features);
    to.patches = to_core(from.features().patches(), to.patches);
    to.sizing = to_core(from.sizing());
    read(from.relaxation(), to.relax);
    to.seed.preload =
        from.relaxation().has_preload() ? from.relaxation().preload() : to.seed.preload;
    to.population.passes = from.relaxation().has_population_passes()
                               ? from.relaxation().population_passes()
                               : to.population.passes;
    read(from.improvement(), to.improve);
    read(from.bounds(), to.bounds);
    if (from.has_max_tets()) {
        to.max_tets = from.max_tets();
    }
    return to;
}

v1::Options to_proto(const RemeshOptions& from) {
    v1::Options to;
    if (from.edge_length) {
        to.set_edge_length(*from.edge_length);
    }
    to.set_tetrahedra(from.tetrahedra);
    to.set_seed(from.seed.seed);
    auto* prepare = to.mutable_prepare();
    prepare->set_close_holes(from.prepare.close_holes);
    prepare->set_smoothing(to_proto(from.prepare.smoothing));
    prepare->set_max_displacement(from.prepare.max_displacement);
    prepare->set_speck_volume(from.prepare.speck_volume);
    prepare->set_keep_cavities(from.prepare.keep_cavities);
    auto* features = to.mutable_features();
    features->set_detect(from.features.detect);
    features->set_sharp_angle(from.features.sharp_angle);
    features->set_corner_angle(from.features.corner_angle);
    features->set_patches(to_proto(from.patches));
    *to.mutable_sizing() = to_proto(from.sizing);
    auto* relaxation = to.mutable_relaxation();
    relaxation->set_force(to_proto(from.relax.force));
    relaxation->set_integrator(to_proto(from.relax.integrator));
    relaxation->set_mass(from.relax.mass);
    relaxation->set_damping(from.relax.damping);
    relaxation->set_charge_exponent(from.relax.charge_exponent);
    relaxation->set_preload(from.seed.preload);
    relaxation->set_max_surface_iterations(from.relax.max_surface_iterations);
    if (from.relax.max_volume_iterations) {
        relaxation->set_max_volume_iterations(*from.relax.max_volume_iterations);
    }
    relaxation->set_tolerance(from.relax.tolerance);
    relaxation->set_population_passes(from.population.passes);
    auto* improvement = to.mutable_improvement();
    improvement->set_mode(to_proto(from.improve.mode));
    improvement->set_passes(from.improve.passes);
    write(from.bounds, *to.mutable_bounds());
    if (from.max_tets) {
        to.set_max_tets(*from.max_tets);
    }
    return to;
}

std::string proto_field(const std::string& field) {
    if (field.starts_with("outputs[")) {
        return "spec." + field;
    }
    const std::string options = "spec.options.";
    if (field == "seed.seed") {
        return options + "seed";
    }
    if (field == "population.passes") {
        return options + "relaxation.population_passes";
    }
    if (field == "seed.preload") {
        return options + "relaxation.preload";
    }
    for (const auto& [core, proto] :
         {std::pair<std::string_view, std::string_view>{"relax.", "relaxation."},
          {"improve.", "improvement."}}) {
        if (field.starts_with(core)) {
            return options + std::string(proto) + field.substr(core.size());
        }
    }
    return options + field;
}

}  // namespace remesh
