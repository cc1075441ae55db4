#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/commands.h"
#include "client/create_job.h"
#include "client/formats.h"
#include "client/json.h"
#include "client/options.h"
#include "client/text.h"

namespace remesh::client {
namespace {

struct SubmitArguments {
    std::vector<std::string> inputs;
    std::vector<std::string> formats;
    std::string input_format;
    v1::JobSpec spec;
};

ExitCode submit(const SubmitArguments& arguments, Session& session) {
    v1::JobSpec spec = arguments.spec;
    if (!arguments.input_format.empty()) {
        spec.mutable_input()->set_format(format_named(arguments.input_format));
    }
    for (const v1::Format format : wanted_formats(arguments.formats, spec.options())) {
        spec.add_outputs()->set_format(format);
    }
    std::vector<InputFile> files;
    for (const std::string& input : arguments.inputs) {
        files.emplace_back(input);
    }
    for (const InputFile& file : files) {
        const v1::Job job = create_job(session.named_server(), file, spec);
        fmt::print("{}\n", session.settings().json ? json_line(job) : sanitised(job.name()));
        std::fflush(stdout);  // Jobs that exist are known even if a later one is refused.
    }
    return ExitCode::Ok;
}

}  // namespace

void add_submit(CLI::App& app, Action& chosen) {
    CLI::App* command =
        app.add_subcommand("submit", "Send surfaces to a server and print one job name a line");
    const auto arguments = std::make_shared<SubmitArguments>();
    command->add_option("IN", arguments->inputs, "Surfaces to remesh; - is stdin")
        ->type_name("FILE")
        ->required();
    command
        ->add_option("--format", arguments->formats,
                     "Format wanted back, e.g. vtu, ply, msh22 (repeatable; vtu and ply if absent)")
        ->type_name("FORMAT")
        ->allow_extra_args(false);
    command
        ->add_option("--input-format", arguments->input_format,
                     "Format of the input; found from its content if absent")
        ->type_name("FORMAT");
    add_job_options(*command, arguments->spec);
    command->callback([arguments, &chosen] {
        chosen = [arguments](Session& session) { return submit(*arguments, session); };
    });
    command->footer(
        "Example:\n"
        "  job=$(remesh --server meshes:50051 submit aorta.stl --edge-length 1.2)\n"
        "  remesh --server meshes:50051 watch $job\n"
        "  remesh --server meshes:50051 get $job -o aorta.vtu -o aorta.ply\n"
        "Defaults of the options: remesh capabilities");
}

}  // namespace remesh::client
