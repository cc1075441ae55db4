#include "client/results.h"

#include <fmt/format.h>

#include "client/failure.h"
#include "client/text.h"
#include "client/transfer.h"

namespace remesh::client {
namespace {

namespace fs = std::filesystem;

Failure no_such_output(const v1::Job& job, const std::string& wanted) {
    std::vector<std::string> there;
    for (const v1::Output& output : outputs_of(job)) {
        there.push_back(
            fmt::format("{} ({})", sanitised(output.file_name()), kind_word(output.kind())));
    }
    return {ExitCode::BadInput,
            fmt::format("the job has no output for {}; there is {}", sanitised(wanted),
                        there.empty() ? "nothing" : fmt::format("{}", fmt::join(there, ", ")))};
}

bool is_preview(const v1::Output& output) {
    return output.kind() == v1::Output::KIND_PREVIEW ||
           output.kind() == v1::Output::KIND_PREVIEW_TETRAHEDRA;
}

/// The first output that `fits`, tets before everything else, previews never.
template <typename Fits>
const v1::Output* best_output(const v1::Job& job, Fits fits) {
    const v1::Output* best = nullptr;
    for (const v1::Output& output : outputs_of(job)) {
        const bool is_better = best == nullptr || (output.kind() == v1::Output::KIND_TETRAHEDRA &&
                                                   best->kind() != v1::Output::KIND_TETRAHEDRA);
        if (!is_preview(output) && is_better && fits(output)) {
            best = &output;
        }
    }
    return best;
}

}  // namespace

const google::protobuf::RepeatedPtrField<v1::Output>& outputs_of(const v1::Job& job) {
    return job.has_failure() ? job.failure().outputs() : job.result().outputs();
}

const v1::Output& output_in(const v1::Job& job, v1::Format format) {
    const auto* found =
        best_output(job, [&](const v1::Output& output) { return output.format() == format; });
    if (found == nullptr) {
        throw no_such_output(job, format_word(format));
    }
    return *found;
}

const v1::Output& output_of(const v1::Job& job, v1::Output::Kind kind) {
    for (const v1::Output& output : outputs_of(job)) {
        if (output.kind() == kind) {
            return output;
        }
    }
    throw no_such_output(job, kind_word(kind));
}

const v1::Output& output_for(const v1::Job& job, const fs::path& path) {
    const std::string extension = lower_case(path.extension().string());
    if (extension == ".json") {
        return output_of(job, v1::Output::KIND_REPORT);
    }
    const auto* found = best_output(job, [&](const v1::Output& output) {
        const fs::path name(output.file_name());
        return !extension.empty() && lower_case(name.extension().string()) == extension;
    });
    if (found == nullptr) {
        throw no_such_output(job, path.string());
    }
    return *found;
}

const v1::Output& report_for(const v1::Job& job, const fs::path& path) {
    return output_of(job, lower_case(path.extension().string()) == ".html"
                              ? v1::Output::KIND_REPORT_PAGE
                              : v1::Output::KIND_REPORT);
}

void deliver(Connection& connection, const std::vector<Delivery>& deliveries) {
    std::vector<PendingFile> files;
    for (const Delivery& delivery : deliveries) {
        files.push_back(download(connection, delivery.output.digest(), delivery.target));
    }
    for (PendingFile& file : files) {
        file.commit();
    }
}

std::string delivery_words(const std::vector<Delivery>& deliveries) {
    std::vector<std::string> words;
    for (const Delivery& delivery : deliveries) {
        words.push_back(fmt::format("{} ({})", sanitised(delivery.target.string()),
                                    bytes_word(delivery.output.digest().size_bytes())));
    }
    return fmt::format("{}", fmt::join(words, ", "));
}

}  // namespace remesh::client
