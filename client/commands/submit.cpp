#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/commands/commands.h"
#include "client/commands/estimate.h"
#include "client/create_job.h"
#include "client/formats.h"
#include "client/json.h"
#include "client/options.h"
#include "client/text.h"

namespace remesh::client {
namespace {

ExitCode submit(const JobArguments& arguments, Session& session) {
    v1::JobSpec spec = arguments.spec;
    for (const v1::Format format : wanted_formats(arguments.formats, spec.options())) {
        spec.add_outputs()->set_format(format);
    }
    const std::optional<InputFile> size_image = open_size_image(arguments);
    std::vector<InputFile> files;
    for (const std::string& input : arguments.inputs) {
        files.emplace_back(input);
    }
    for (const InputFile& file : files) {
        const JobFiles inputs{file, size_image ? &*size_image : nullptr};
        if (arguments.wants_estimate) {
            tell_estimate(inputs, spec, session.named_server(), session.settings());
            continue;
        }
        const v1::Job job = create_job(session.named_server(), inputs, spec);
        fmt::print("{}\n", session.settings().json ? json_line(job) : sanitised(job.name()));
        std::fflush(stdout);  // Jobs that exist are known even if a later one is refused.
    }
    return ExitCode::Ok;
}

}  // namespace

void add_submit(CLI::App& app, Action& chosen) {
    CLI::App* command =
        app.add_subcommand("submit", "Send surfaces to a server and print one job name a line");
    const auto arguments = std::make_shared<JobArguments>();
    add_job_arguments(*command, *arguments);
    command->callback([arguments, &chosen] {
        chosen = [arguments](Session& session) { return submit(*arguments, session); };
    });
    command->footer(
        "Without --format it asks for vtu (tets) and ply (surface).\n"
        "\n"
        "Example:\n"
        "  job=$(remesh --server meshes:50051 submit aorta.stl --edge-length 1.2)\n"
        "  remesh --server meshes:50051 watch $job\n"
        "  remesh --server meshes:50051 get $job -o aorta.vtu -o aorta.ply\n"
        "Defaults of the options: remesh capabilities");
}

}  // namespace remesh::client
