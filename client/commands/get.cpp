#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "client/commands/commands.h"
#include "client/formats.h"
#include "client/results.h"
#include "client/text.h"

namespace remesh::client {
namespace {

struct GetArguments {
    std::string name;
    std::vector<std::string> targets;
    std::string format;
    std::string kind;
};

const v1::Output& chosen_output(const v1::Job& job, const GetArguments& arguments,
                                const std::string& target) {
    if (!arguments.kind.empty()) {
        v1::Output::Kind kind = v1::Output::KIND_UNSPECIFIED;
        for (const v1::Output& output : outputs_of(job)) {
            if (kind_word(output.kind()) == arguments.kind) {
                kind = output.kind();
            }
        }
        return output_of(job, kind);
    }
    return arguments.format.empty() ? output_for(job, target)
                                    : output_in(job, format_named(arguments.format));
}

ExitCode get(const GetArguments& arguments, Session& session) {
    Connection& server = session.named_server();
    const v1::Job job = server.get_job(arguments.name);
    if (!is_terminal(job.state())) {
        throw Failure(ExitCode::BadInput, fmt::format("the job is still {}: follow it with watch",
                                                      state_word(job.state())));
    }
    if (outputs_of(job).empty()) {
        require_success(job);
    }
    std::vector<Delivery> deliveries;
    for (const std::string& target : arguments.targets) {
        deliveries.push_back({chosen_output(job, arguments, target), target});
    }
    deliver(server, deliveries);
    session.note("wrote " + delivery_words(deliveries));
    return ExitCode::Ok;
}

}  // namespace

void add_get(CLI::App& app, Action& chosen) {
    CLI::App* command = app.add_subcommand("get", "Download outputs of a finished job");
    const auto arguments = std::make_shared<GetArguments>();
    command->add_option("JOB", arguments->name, "Name as printed by submit and list")
        ->type_name("NAME")
        ->required();
    command
        ->add_option(
            "-o,--output", arguments->targets,
            "File to write; its extension picks the output, .json and .html the report; - is "
            "stdout "
            "(repeatable)")
        ->type_name("FILE")
        ->allow_extra_args(false)
        ->required();
    command->add_option("--format", arguments->format, "Pick by format, whatever the name")
        ->type_name("FORMAT");
    command->add_option("--kind", arguments->kind, "Pick by kind, whatever the name")
        ->type_name("surface|tetrahedra|report|report_page|preview")
        ->check(CLI::IsMember({"surface", "tetrahedra", "report", "report_page", "preview"})
                    .description(""));
    command->callback([arguments, &chosen] {
        chosen = [arguments](Session& session) { return get(*arguments, session); };
    });
}

}  // namespace remesh::client
