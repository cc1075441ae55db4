#include "server/convert/values.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "server/convert.h"

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

}  // namespace

std::optional<MeshFormat> to_core(v1::Format format) {
    const auto* found = std::find_if(kFormats.begin(), kFormats.end(),
                                     [&](const auto& pair) { return pair.second == format; });
    return found == kFormats.end() ? std::nullopt : std::optional(found->first);
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

google::protobuf::Timestamp to_proto(Time time) {
    const auto micros = time.time_since_epoch().count();
    google::protobuf::Timestamp to;
    to.set_seconds(micros / 1'000'000);
    to.set_nanos(static_cast<std::int32_t>(micros % 1'000'000) * 1'000);
    return to;
}

google::protobuf::Duration duration_of(double seconds) {
    google::protobuf::Duration duration;
    duration.set_seconds(static_cast<std::int64_t>(seconds));
    duration.set_nanos(static_cast<std::int32_t>(1e9 * (seconds - std::floor(seconds))));
    return duration;
}

}  // namespace remesh
