#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/error.h"
#include "core/estimate.h"
#include "core/image/read_image.h"
#include "core/io/mesh_io.h"
#include "core/pipeline.h"
#include "core/run_context.h"
#include "server/store/job_store.h"

namespace remesh {

enum class OutputContent {
    Automatic,  ///< Tets if the format can hold them and the job makes them, else the surface.
    Surface,
    Tetrahedra,
};

struct OutputRequest {
    MeshFormat format = MeshFormat::Stl;
    OutputContent content = OutputContent::Automatic;
};

/// An image of sizes that is an input, too.
struct SizeImageRequest {
    ArtifactId artifact{};
    std::optional<ImageFormat> format{};  ///< Absent: found from the content.
    SurfaceFrame frame{};                 ///< Of the surface.
};

/// Bytes of a job's input files.
struct JobFiles {
    std::string_view surface{};
    std::string_view size_image{};  ///< Empty unless the request has one.
};

/// What a client asked for, as far as a worker needs to know.
struct JobRequest {
    ArtifactId input{};
    std::optional<MeshFormat> input_format{};  ///< Absent: found from the content and the name.
    std::string file_name{};                   ///< Last part of a path, may be empty.
    std::string unit{};                        ///< Of lengths, "mm", "cm" or "m"; empty: not said.
    std::string space{};                       ///< Of coordinates, "LPS" or "RAS"; empty: not said.
    std::optional<SizeImageRequest> size_image{};
    RemeshOptions options{};
    std::vector<OutputRequest> outputs{};
    int priority = 0;                               ///< In [-100, 100].
    std::optional<std::chrono::seconds> timeout{};  ///< Absent: the server's limit.
    bool skip_cache = false;                        ///< Run it even if its result is there.

    /// Digests of all files that it needs.
    [[nodiscard]] std::vector<std::string> inputs() const {
        std::vector<std::string> digests{input.sha256};
        if (size_image) {
            digests.push_back(size_image->artifact.sha256);
        }
        return digests;
    }
};

/// What a run is likely to need; see core/estimate.h.
using JobEstimate = RunEstimate;

enum class OutputKind { Surface, Tetrahedra, Report, Preview, ReportPage, PreviewTetrahedra };

/// One file of a result.
struct JobOutput {
    OutputKind kind = OutputKind::Surface;
    std::optional<MeshFormat> format{};  ///< Absent for the report and its page.
    ArtifactId artifact{};
    std::string file_name{};
};

struct JobResult {
    std::vector<JobOutput> outputs{};
    QualityReport report{};
    RemeshOptions options{};      ///< With everything that was chosen filled in.
    std::string broken_bounds{};  ///< A sentence, if the result doesn't keep what was asked for.
};

/// Why an attempt ended without a result.
struct JobFailure {
    std::string reason{};   ///< Stable UPPER_SNAKE_CASE.
    std::string message{};  ///< A sentence.
    bool retryable = false;
    Stage stage = Stage::Read;
    std::vector<JobOutput> outputs{};  ///< Files kept all the same.
};

/// One option by its name in the API, for people to read.
struct OptionRow {
    std::string name{};
    std::string value{};
};

/// A preview that can be downloaded.
struct StoredPreview {
    ArtifactId artifact{};
    int iteration = 0;
};

using JobEventBody = std::variant<Progress, ConvergenceSample, Warning, StoredPreview>;

/// One field of a request that is out of its range.
struct FieldProblem {
    std::string field{};  ///< As the engine calls it, e.g. "relax.damping".
    std::string message{};
};

enum class JobErrorCode {
    NotFound,
    BadRequest,
    MissingInput,
    RequestIdReused,
    LimitPassed,
    NotTerminal,
    NotRetryable,
    Changed,  ///< The caller's idea of the job is out of date.
    ShuttingDown,
};

/// Stable UPPER_SNAKE_CASE name of an error, for callers: "INVALID_INPUT".
[[nodiscard]] const char* reason_of(ErrorCode code);

/// Why the registry refuses a call.
class JobError : public std::runtime_error {
public:
    JobError(JobErrorCode code, const std::string& message, std::string subject = {})
        : std::runtime_error(message), code_(code), subject_(std::move(subject)) {}
    explicit JobError(std::vector<FieldProblem> problems);

    [[nodiscard]] JobErrorCode code() const noexcept { return code_; }
    /// What it is about: a job, a digest.
    [[nodiscard]] const std::string& subject() const noexcept { return subject_; }
    /// Of a BadRequest.
    [[nodiscard]] const std::vector<FieldProblem>& problems() const noexcept { return problems_; }

private:
    JobErrorCode code_;
    std::string subject_;
    std::vector<FieldProblem> problems_;
};

}  // namespace remesh
