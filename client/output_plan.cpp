#include "client/output_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "client/failure.h"
#include "client/formats.h"
#include "client/text.h"

namespace remesh::client {
namespace {

namespace fs = std::filesystem;

Failure cannot_write(const fs::path& target, const std::string& why) {
    return {ExitCode::Usage, fmt::format("can't write {}: {}", sanitised(target.string()), why)};
}

/// --format decides where it fits the name or the name says nothing; else the name does.
v1::Format format_of_output(const JobArguments& job, const fs::path& target,
                            const v1::GetCapabilitiesResponse& server) {
    const std::string extension = lower_case(target.extension().string());
    const auto& formats = server.formats();
    const bool is_known =
        std::any_of(formats.begin(), formats.end(), [&](const v1::FormatCapability& format) {
            return lower_case(format.extension()) == extension;
        });
    for (const std::string& word : job.formats) {
        const v1::Format format = format_named(word);
        if (!is_known || lower_case(extension_of(format, server)) == extension) {
            return format;
        }
    }
    return format_for(target, server);
}

void require_file_or_nothing(const fs::path& target) {
    std::error_code ignored;
    const fs::path folder = target.has_parent_path() ? target.parent_path() : ".";
    if (!fs::is_directory(folder, ignored)) {
        throw cannot_write(target, "there is no folder " + sanitised(folder.string()));
    }
    if (fs::is_directory(target, ignored)) {
        throw cannot_write(target, "it is a folder");
    }
}

}  // namespace

std::vector<PlannedFile> plan_outputs(const OutputWishes& wishes, const JobArguments& job,
                                      const fs::path& input,
                                      const v1::GetCapabilitiesResponse& server) {
    std::vector<PlannedFile> files;
    for (const std::string& output : wishes.outputs) {
        files.push_back({format_of_output(job, output, server), output});
    }
    if (!files.empty()) {
        return files;
    }
    for (const v1::Format format : wanted_formats(job.formats, job.spec.options())) {
        const std::string name = stem_of(input) + "_remeshed" + extension_of(format, server);
        files.push_back({format, fs::path(wishes.output_dir) / name});
    }
    return files;
}

void require_writable(const std::vector<PlannedFile>& files, const std::vector<fs::path>& inputs) {
    std::set<fs::path> targets;
    std::error_code ignored;
    for (const PlannedFile& file : files) {
        const fs::path& target = file.target;
        if (target != "-") {
            require_file_or_nothing(target);
        }
        if (!targets.insert(fs::weakly_canonical(target, ignored)).second) {
            throw cannot_write(target, "it would be written twice");
        }
        for (const fs::path& input : inputs) {
            if (fs::equivalent(input, target, ignored)) {
                throw cannot_write(target, "it is an input");
            }
        }
    }
}

}  // namespace remesh::client
