#include <algorithm>

#include "server/convert.h"
#include "server/convert/spec.h"
#include "server/convert/values.h"
#include "server/store/digest.h"
#include "server/version.h"

namespace remesh {
namespace {

void write(const QualitySample& from, v1::QualitySample* to) {
    to->set_mean(from.mean);
    to->set_first_percentile(from.first_percentile);
    to->mutable_histogram()->set_low(0.0);
    to->mutable_histogram()->set_high(1.0);
    to->mutable_histogram()->mutable_counts()->Assign(from.histogram.begin(), from.histogram.end());
}

void write(const Progress& from, v1::JobEvent& to) {
    *to.mutable_progress() = to_proto(from);
}

void write(const ConvergenceSample& from, v1::JobEvent& event) {
    auto* to = event.mutable_sample();
    to->set_stage(to_proto(from.stage));
    to->set_iteration(from.iteration);
    to->set_simulated_time(from.simulated_time);
    to->set_kinetic_energy(from.kinetic_energy);
    to->set_potential_energy(from.potential_energy);
    to->set_max_displacement(from.max_displacement);
    to->set_rms_displacement(from.rms_displacement);
    to->set_residual_force(from.residual_force);
    to->set_particles(from.particles);
    to->set_surface_particles(from.surface_particles);
    to->set_inserted(from.inserted);
    to->set_removed(from.removed);
    if (from.quality) {
        write(*from.quality, to->mutable_quality());
    }
    if (from.max_deviation) {
        to->set_max_deviation(*from.max_deviation);
    }
}

void write(const Warning& from, v1::JobEvent& event) {
    auto* to = event.mutable_warning();
    to->set_code(from.code);
    to->set_message(from.message);
    if (from.at) {
        to->mutable_at()->Assign(from.at->begin(), from.at->end());
    }
}

void write(const StoredPreview& from, v1::JobEvent& event) {
    *event.mutable_preview()->mutable_digest() = to_proto(from.artifact);
    event.mutable_preview()->set_iteration(from.iteration);
}

void write(const JobOutput& from, v1::Output& to) {
    to.set_kind(to_proto(from.kind));
    if (from.format) {
        to.set_format(to_proto(*from.format));
    }
    *to.mutable_digest() = to_proto(from.artifact);
    to.set_file_name(from.file_name);
}

}  // namespace

JobRequest ProtoCodec::decode_spec(std::string_view spec) const {
    return to_core(parse_spec(spec));
}

std::string ProtoCodec::cache_key(std::string_view spec) const {
    v1::JobSpec key = parse_spec(spec);
    // What doesn't change the result.
    key.clear_priority();
    key.clear_timeout();
    key.clear_labels();
    key.clear_skip_cache();
    return sha256_of(std::string("remesh ") + kVersion + '\n' + bytes_of(key));
}

Progress ProtoCodec::decode_progress(std::string_view event) const {
    v1::JobEvent from;
    from.ParseFromArray(event.data(), static_cast<int>(event.size()));
    const v1::Progress& progress = from.progress();
    const int stage =
        std::clamp(static_cast<int>(progress.stage()) - 1, 0, static_cast<int>(kStageCount) - 1);
    return {static_cast<Stage>(stage), progress.stage_fraction(), progress.fraction()};
}

std::string ProtoCodec::encode_event(const JobEventBody& event) const {
    v1::JobEvent to;
    std::visit([&](const auto& body) { write(body, to); }, event);
    return to.SerializeAsString();
}

std::string ProtoCodec::encode_result(std::string_view spec, const JobResult& result) const {
    const v1::JobSpec asked = parse_spec(spec);
    v1::Result to;
    for (const JobOutput& output : result.outputs) {
        write(output, *to.add_outputs());
    }
    *to.mutable_quality() = to_proto(result.report);
    auto* provenance = to.mutable_provenance();
    provenance->set_engine_version(kVersion);
    *provenance->mutable_options() = to_proto(result.options);
    *provenance->mutable_input() = asked.input().digest();
    *provenance->mutable_frame() = asked.input().frame();
    if (asked.has_size_image()) {
        *provenance->mutable_size_image() = asked.size_image().digest();
    }
    return to.SerializeAsString();
}

std::string ProtoCodec::encode_failure(const JobFailure& failure) const {
    v1::Failure to;
    to.set_reason(failure.reason);
    to.set_message(failure.message);
    to.set_retryable(failure.retryable);
    to.set_stage(to_proto(failure.stage));
    for (const JobOutput& output : failure.outputs) {
        write(output, *to.add_outputs());
    }
    return to.SerializeAsString();
}

}  // namespace remesh
