#include "server/convert/spec.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <utility>

#include "server/convert.h"
#include "server/store/digest.h"

namespace remesh {
namespace {

constexpr const char* kSha256Rule = "must be 64 lower-case hexadecimal digits";
constexpr std::int64_t kMaxTimeoutSeconds = 365 * 24 * 3'600;
// A job holds its options twice, as asked for and as used, and must fit into a message of 4 MiB.
constexpr std::size_t kMaxSpecBytes = std::size_t{3} << 19U;

/// Only the last part of a path, whichever system it comes from.
std::string last_part(const std::string& path) {
    return path.substr(path.find_last_of("/\\") + 1);
}

/// Gathers what proto's types allow but a spec doesn't.
class SpecCheck {
public:
    explicit SpecCheck(const v1::JobSpec& spec) : spec_(spec) {}

    std::vector<FieldProblem> problems() && {
        check_files();
        check_outputs();
        check_limits();
        return std::move(problems_);
    }

private:
    void add(const std::string& field, const std::string& rule) {
        problems_.push_back({field, field + " " + rule});
    }

    void check_files() {
        const v1::Input& input = spec_.input();
        if (!is_sha256(input.digest().sha256())) {
            add("spec.input.digest.sha256", kSha256Rule);
        }
        if (spec_.has_size_image() && !is_sha256(spec_.size_image().digest().sha256())) {
            add("spec.size_image.digest.sha256", kSha256Rule);
        }
        if (!v1::ImageFormat_IsValid(spec_.size_image().format())) {
            add("spec.size_image.format",
                "must be a known format, got " + std::to_string(spec_.size_image().format()));
        }
        if (input.file_name().size() > 255) {
            add("spec.input.file_name",
                "must have at most 255 bytes, got " + std::to_string(input.file_name().size()));
        }
        if (input.format() != v1::FORMAT_UNSPECIFIED && !to_core(input.format())) {
            add("spec.input.format",
                "must be a known format, got " + std::to_string(input.format()));
        }
    }

    void check_outputs() {
        if (spec_.outputs().empty() || spec_.outputs_size() > 16) {
            add("spec.outputs", "must be 1 to 16, got " + std::to_string(spec_.outputs_size()));
        }
        for (int i = 0; i < spec_.outputs_size(); ++i) {
            if (!to_core(spec_.outputs(i).format())) {
                add("spec.outputs[" + std::to_string(i) + "].format",
                    "must be a known format, got " + std::to_string(spec_.outputs(i).format()));
            }
        }
    }

    void check_limits() {
        if (spec_.priority() < -100 || spec_.priority() > 100) {
            add("spec.priority", "must be in [-100, 100], got " + std::to_string(spec_.priority()));
        }
        if (const auto seconds = spec_.timeout().seconds();
            spec_.has_timeout() && (seconds < 1 || seconds > kMaxTimeoutSeconds)) {
            add("spec.timeout",
                "must be in [1, 31536000] seconds, got " + std::to_string(seconds) + " s");
        }
        if (const std::size_t size = spec_.ByteSizeLong(); size > kMaxSpecBytes) {
            add("spec", "must have at most 1.5 MiB, got " + std::to_string(size) + " bytes");
        }
        if (spec_.labels_size() > 16) {
            add("spec.labels", "must be at most 16, got " + std::to_string(spec_.labels_size()));
        }
        for (const auto& [key, value] : spec_.labels()) {
            if (key.size() > 64 || value.size() > 256) {
                add("spec.labels", "must have keys of at most 64 bytes and values of at most 256");
            }
        }
    }

    const v1::JobSpec& spec_;
    std::vector<FieldProblem> problems_;
};

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

double millimeters_of(v1::Unit unit) {
    switch (unit) {
        case v1::UNIT_CENTIMETER: return 10.0;
        case v1::UNIT_METER: return 1000.0;
        default: return 1.0;
    }
}

std::optional<ImageFormat> to_core(v1::ImageFormat format) {
    switch (format) {
        case v1::IMAGE_FORMAT_NIFTI: return ImageFormat::Nifti;
        case v1::IMAGE_FORMAT_NRRD: return ImageFormat::Nrrd;
        case v1::IMAGE_FORMAT_META_IMAGE: return ImageFormat::MetaImage;
        default: return std::nullopt;
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

}  // namespace

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

std::string canonical_spec(const v1::JobSpec& spec) {
    if (auto problems = SpecCheck(spec).problems(); !problems.empty()) {
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

}  // namespace remesh
