#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "server/convert.h"
#include "server/store/digest.h"
#include "server/version.h"

namespace remesh {
namespace {

constexpr std::array<std::pair<MeshFormat, v1::Format>, 11> kFormats{{
    {MeshFormat::Stl, v1::FORMAT_STL},
    {MeshFormat::Ply, v1::FORMAT_PLY},
    {MeshFormat::Off, v1::FORMAT_OFF},
    {MeshFormat::Obj, v1::FORMAT_OBJ},
    {MeshFormat::Vtp, v1::FORMAT_VTP},
    {MeshFormat::Vtk, v1::FORMAT_VTK},
    {MeshFormat::Gifti, v1::FORMAT_GIFTI},
    {MeshFormat::Vtu, v1::FORMAT_VTU},
    {MeshFormat::Medit, v1::FORMAT_MEDIT},
    {MeshFormat::Msh41, v1::FORMAT_MSH41},
    {MeshFormat::Msh22, v1::FORMAT_MSH22},
}};

constexpr std::int64_t kMaxTimeoutSeconds = 365 * 24 * 3'600;
// A job holds its options twice, as asked for and as used, and must fit into a message of 4 MiB.
constexpr std::size_t kMaxSpecBytes = std::size_t{3} << 19U;

v1::Job::State to_proto(JobState state) {
    switch (state) {
        case JobState::Queued: return v1::Job::STATE_QUEUED;
        case JobState::Running: return v1::Job::STATE_RUNNING;
        case JobState::Cancelling: return v1::Job::STATE_CANCELLING;
        case JobState::Succeeded: return v1::Job::STATE_SUCCEEDED;
        case JobState::Failed: return v1::Job::STATE_FAILED;
        case JobState::Cancelled: return v1::Job::STATE_CANCELLED;
        case JobState::Quarantined: return v1::Job::STATE_QUARANTINED;
    }
    return v1::Job::STATE_UNSPECIFIED;
}

v1::Output::Kind to_proto(OutputKind kind) {
    switch (kind) {
        case OutputKind::Surface: return v1::Output::KIND_SURFACE;
        case OutputKind::Tetrahedra: return v1::Output::KIND_TETRAHEDRA;
        case OutputKind::Report: return v1::Output::KIND_REPORT;
        case OutputKind::Preview: return v1::Output::KIND_PREVIEW;
        case OutputKind::ReportPage: return v1::Output::KIND_REPORT_PAGE;
        case OutputKind::PreviewTetrahedra: return v1::Output::KIND_PREVIEW_TETRAHEDRA;
    }
    return v1::Output::KIND_UNSPECIFIED;
}

v1::Digest to_proto(const ArtifactId& artifact) {
    v1::Digest digest;
    digest.set_sha256(artifact.sha256);
    digest.set_size_bytes(artifact.size);
    return digest;
}

v1::Progress to_proto(const Progress& from) {
    v1::Progress to;
    to.set_stage(to_proto(from.stage));
    to.set_stage_fraction(from.stage_fraction);
    to.set_fraction(from.run_fraction);
    return to;
}

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

google::protobuf::Duration duration_of(double seconds) {
    google::protobuf::Duration duration;
    duration.set_seconds(static_cast<std::int64_t>(seconds));
    duration.set_nanos(static_cast<std::int32_t>(1e9 * (seconds - std::floor(seconds))));
    return duration;
}

/// "mm", or nothing if it wasn't said.
std::string unit_sign(v1::Unit unit) {
    return unit == v1::UNIT_MILLIMETER   ? "mm"
           : unit == v1::UNIT_CENTIMETER ? "cm"
           : unit == v1::UNIT_METER      ? "m"
                                         : "";
}

std::string space_name(v1::Space space) {
    return space == v1::SPACE_LPS ? "LPS" : space == v1::SPACE_RAS ? "RAS" : "";
}

/// Only the last part of a path, whichever system it comes from.
std::string last_part(const std::string& path) {
    return path.substr(path.find_last_of("/\\") + 1);
}

v1::JobSpec parse_spec(std::string_view bytes) {
    v1::JobSpec spec;
    if (!spec.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
        throw StoreError("store: a job's spec can't be read");
    }
    return spec;
}

std::string bytes_of(const v1::JobSpec& spec) {
    std::string bytes;
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);  // labels are a map
    spec.SerializeToCodedStream(&coded);
    coded.Trim();
    return bytes;
}

[[noreturn]] void refuse(const std::string& field, const std::string& message) {
    throw JobError({FieldProblem{field, field + " " + message}});
}

/// What proto's types allow but a spec doesn't.
std::vector<FieldProblem> problems_of(const v1::JobSpec& spec) {
    std::vector<FieldProblem> problems;
    const auto add = [&](const std::string& field, const std::string& rule) {
        problems.push_back({field, field + " " + rule});
    };
    if (!is_sha256(spec.input().digest().sha256())) {
        add("spec.input.digest.sha256", "must be 64 lower-case hexadecimal digits");
    }
    if (spec.has_size_image() && !is_sha256(spec.size_image().digest().sha256())) {
        add("spec.size_image.digest.sha256", "must be 64 lower-case hexadecimal digits");
    }
    if (!v1::ImageFormat_IsValid(spec.size_image().format())) {
        add("spec.size_image.format",
            "must be a known format, got " + std::to_string(spec.size_image().format()));
    }
    if (spec.input().file_name().size() > 255) {
        add("spec.input.file_name",
            "must have at most 255 bytes, got " + std::to_string(spec.input().file_name().size()));
    }
    if (spec.input().format() != v1::FORMAT_UNSPECIFIED && !to_core(spec.input().format())) {
        add("spec.input.format",
            "must be a known format, got " + std::to_string(spec.input().format()));
    }
    if (spec.outputs().empty() || spec.outputs_size() > 16) {
        add("spec.outputs", "must be 1 to 16, got " + std::to_string(spec.outputs_size()));
    }
    for (int i = 0; i < spec.outputs_size(); ++i) {
        if (!to_core(spec.outputs(i).format())) {
            add("spec.outputs[" + std::to_string(i) + "].format",
                "must be a known format, got " + std::to_string(spec.outputs(i).format()));
        }
    }
    if (spec.priority() < -100 || spec.priority() > 100) {
        add("spec.priority", "must be in [-100, 100], got " + std::to_string(spec.priority()));
    }
    if (const auto seconds = spec.timeout().seconds();
        spec.has_timeout() && (seconds < 1 || seconds > kMaxTimeoutSeconds)) {
        add("spec.timeout",
            "must be in [1, 31536000] seconds, got " + std::to_string(seconds) + " s");
    }
    if (const std::size_t size = spec.ByteSizeLong(); size > kMaxSpecBytes) {
        add("spec", "must have at most 1.5 MiB, got " + std::to_string(size) + " bytes");
    }
    if (spec.labels_size() > 16) {
        add("spec.labels", "must be at most 16, got " + std::to_string(spec.labels_size()));
    }
    for (const auto& [key, value] : spec.labels()) {
        if (key.size() > 64 || value.size() > 256) {
            add("spec.labels", "must have keys of at most 64 bytes and values of at most 256");
        }
    }
    return problems;
}

std::optional<ImageFormat> to_core(v1::ImageFormat format) {
    switch (format) {
        case v1::IMAGE_FORMAT_NIFTI: return ImageFormat::Nifti;
        case v1::IMAGE_FORMAT_NRRD: return ImageFormat::Nrrd;
        case v1::IMAGE_FORMAT_META_IMAGE: return ImageFormat::MetaImage;
        default: return std::nullopt;
    }
}

double millimeters_of(v1::Unit unit) {
    switch (unit) {
        case v1::UNIT_CENTIMETER: return 10.0;
        case v1::UNIT_METER: return 1000.0;
        default: return 1.0;
    }
}

SizeImageRequest to_core(const v1::SizeImage& image, const v1::Frame& frame) {
    SizeImageRequest to;
    to.artifact = {image.digest().sha256(), image.digest().size_bytes()};
    to.format = to_core(image.format());
    to.frame.space = frame.space() == v1::SPACE_LPS   ? SurfaceFrame::Space::Lps
                     : frame.space() == v1::SPACE_RAS ? SurfaceFrame::Space::Ras
                                                      : SurfaceFrame::Space::Unknown;
    to.frame.millimeters = millimeters_of(frame.unit());
    return to;
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

std::optional<MeshFormat> to_core(v1::Format format) {
    const auto* found = std::find_if(kFormats.begin(), kFormats.end(),
                                     [&](const auto& pair) { return pair.second == format; });
    return found == kFormats.end() ? std::nullopt : std::optional(found->first);
}

void require_sha256(const std::string& sha256, const std::string& field) {
    if (!is_sha256(sha256)) {
        refuse(field, "must be 64 lower-case hexadecimal digits");
    }
}

ArtifactId artifact_of(const v1::Digest& digest, const std::string& field) {
    require_sha256(digest.sha256(), field + ".sha256");
    if (digest.size_bytes() < 0) {
        refuse(field + ".size_bytes", "must be >= 0, got " + std::to_string(digest.size_bytes()));
    }
    return {digest.sha256(), digest.size_bytes()};
}

JobKey job_key_of(const std::string& tenant, const std::string& name) {
    if (is_name(name)) {
        return {tenant, name};
    }
    const std::string_view text = name;
    const auto jobs = text.find("/jobs/");
    if (text.starts_with("tenants/") && jobs != std::string_view::npos) {
        const auto owner = text.substr(8, jobs - 8);
        const auto id = text.substr(jobs + 6);
        if (is_name(owner) && is_name(id)) {
            if (owner != tenant) {
                throw JobError(JobErrorCode::NotFound, "there is no such job", std::string(id));
            }
            return {tenant, std::string(id)};
        }
    }
    refuse("name", "must be \"tenants/{tenant}/jobs/{job}\" or \"{job}\"");
}

void require_own(const std::string& tenant, const std::string& parent) {
    if (parent.empty()) {
        return;
    }
    if (!parent.starts_with("tenants/") || !is_name(std::string_view(parent).substr(8))) {
        refuse("parent", "must be \"tenants/{tenant}\" or empty");
    }
    if (parent.substr(8) != tenant) {
        throw AccessError(AccessErrorCode::Denied, "parent must be the caller's own tenant");
    }
}

std::string job_name(const JobKey& key) {
    return "tenants/" + key.tenant + "/jobs/" + key.id;
}

std::int64_t revision_of(const std::string& etag) {
    std::int64_t revision = 0;
    const auto [end, error] = std::from_chars(etag.data(), etag.data() + etag.size(), revision);
    if (error != std::errc{} || end != etag.data() + etag.size()) {
        refuse("etag", "must be one that the server gave");
    }
    return revision;
}

std::string canonical_spec(const v1::JobSpec& spec) {
    if (auto problems = problems_of(spec); !problems.empty()) {
        throw JobError(std::move(problems));
    }
    v1::JobSpec canonical = spec;
    canonical.mutable_input()->set_file_name(last_part(spec.input().file_name()));
    canonical.DiscardUnknownFields();
    return bytes_of(canonical);
}

JobRequest to_core(const v1::JobSpec& spec) {
    JobRequest request;
    request.input = {spec.input().digest().sha256(), spec.input().digest().size_bytes()};
    request.input_format = to_core(spec.input().format());
    request.file_name = spec.input().file_name();
    request.unit = unit_sign(spec.input().frame().unit());
    request.space = space_name(spec.input().frame().space());
    if (spec.has_size_image()) {
        request.size_image = to_core(spec.size_image(), spec.input().frame());
    }
    request.options = to_core(spec.options());
    for (const v1::OutputRequest& output : spec.outputs()) {
        OutputRequest to{to_core(output.format()).value_or(MeshFormat::Stl)};
        to.content = output.content() == v1::OutputRequest::CONTENT_SURFACE ? OutputContent::Surface
                     : output.content() == v1::OutputRequest::CONTENT_TETRAHEDRA
                         ? OutputContent::Tetrahedra
                         : OutputContent::Automatic;
        request.outputs.push_back(to);
    }
    request.priority = spec.priority();
    if (spec.has_timeout()) {
        request.timeout = std::chrono::seconds(spec.timeout().seconds());
    }
    request.skip_cache = spec.skip_cache();
    return request;
}

JobState to_core(v1::Job::State state) {
    switch (state) {
        case v1::Job::STATE_QUEUED: return JobState::Queued;
        case v1::Job::STATE_RUNNING: return JobState::Running;
        case v1::Job::STATE_CANCELLING: return JobState::Cancelling;
        case v1::Job::STATE_SUCCEEDED: return JobState::Succeeded;
        case v1::Job::STATE_FAILED: return JobState::Failed;
        case v1::Job::STATE_CANCELLED: return JobState::Cancelled;
        case v1::Job::STATE_QUARANTINED: return JobState::Quarantined;
        default: refuse("states", "must be known states, got " + std::to_string(state));
    }
}

v1::Job to_proto(const JobView& view) {
    const JobRecord& from = view.job;
    v1::Job to;
    if (!from.key.id.empty()) {
        to.set_name(job_name(from.key));
        to.set_etag(std::to_string(from.revision));
        to.set_state(to_proto(from.state));
        *to.mutable_create_time() = to_proto(from.create_time);
    }
    *to.mutable_spec() = parse_spec(from.spec);
    to.set_attempt(from.attempt);
    to.set_max_attempts(from.max_attempts);
    to.set_queue_position(static_cast<std::int32_t>(view.queue_position));
    if (from.state != JobState::Queued) {
        *to.mutable_progress() = to_proto(view.progress);
    }
    if (from.start_time) {
        *to.mutable_start_time() = to_proto(*from.start_time);
    }
    if (from.end_time) {
        *to.mutable_end_time() = to_proto(*from.end_time);
    }
    if (from.state == JobState::Succeeded) {
        to.mutable_result()->ParseFromString(from.outcome);
    } else if (from.state == JobState::Failed || from.state == JobState::Quarantined) {
        to.mutable_failure()->ParseFromString(from.outcome);
        to.mutable_progress()->set_stage(to.failure().stage());
    }
    to.set_last_sequence(from.last_sequence);
    if (!from.origin.empty()) {
        to.set_origin(job_name({from.key.tenant, from.origin}));
    }
    if (view.estimated_start) {
        *to.mutable_estimated_start_time() = to_proto(*view.estimated_start);
    }
    if (view.estimate) {
        to.mutable_estimate()->set_tets(view.estimate->tets);
        to.mutable_estimate()->set_memory_bytes(view.estimate->memory_bytes);
        *to.mutable_estimate()->mutable_cpu_time() = duration_of(view.estimate->cpu_seconds);
    }
    return to;
}

v1::JobEvent to_proto(const StoredEvent& event, const JobView& job) {
    v1::JobEvent to;
    if (event.kind == EventKind::State) {
        JobView then = job;
        then.job.state = event.state;
        then.job.attempt = event.attempt;
        then.job.last_sequence = event.sequence;
        if (event.state == JobState::Running) {
            then.job.start_time = event.time;
        }
        if (!is_terminal(event.state)) {
            then.job.end_time.reset();
            then.progress = event.state == JobState::Running ? Progress{} : then.progress;
        }
        *(is_terminal(event.state) ? to.mutable_completed() : to.mutable_snapshot()) =
            to_proto(then);
    } else {
        to.ParseFromString(event.payload);
    }
    to.set_sequence(event.sequence);
    *to.mutable_time() = to_proto(event.time);
    return to;
}

v1::Format to_proto(MeshFormat format) {
    const auto* found = std::find_if(kFormats.begin(), kFormats.end(),
                                     [&](const auto& pair) { return pair.first == format; });
    return found == kFormats.end() ? v1::FORMAT_UNSPECIFIED : found->second;
}

v1::Stage to_proto(Stage stage) {
    // Both count the steps in order; proto's zero means none.
    static_assert(v1::STAGE_READ == 1 && v1::STAGE_WRITE == kStageCount);
    return static_cast<v1::Stage>(static_cast<int>(stage) + 1);
}

google::protobuf::Timestamp to_proto(Time time) {
    const auto micros = time.time_since_epoch().count();
    google::protobuf::Timestamp to;
    to.set_seconds(micros / 1'000'000);
    to.set_nanos(static_cast<std::int32_t>(micros % 1'000'000) * 1'000);
    return to;
}

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
