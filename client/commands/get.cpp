#include <fmt/format.h>

#include <map>
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

/// All kinds that an output may have, by their words.
std::map<std::string, v1::Output::Kind> kinds() {
    std::map<std::string, v1::Output::Kind> kinds;
    const auto& values = *v1::Output::Kind_descriptor();
    for (int i = 1; i < values.value_count(); ++i) {
        const auto kind = static_cast<v1::Output::Kind>(values.value(i)->number());
        kinds[kind_word(kind)] = kind;
    }
    return kinds;
}

const v1::Output& chosen_output(const v1::Job& job, const GetArguments& arguments,
                                const std::string& target) {
    if (!arguments.kind.empty()) {
        return output_of(job, kinds().at(arguments.kind));
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
    std::vector<std::string> words;
    for (const auto& [word, kind] : kinds()) {
        words.push_back(word);
    }
    command->add_option("--kind", arguments->kind, "Pick by kind, whatever the name")
        ->type_name(fmt::format("{}", fmt::join(words, "|")))
        ->check(CLI::IsMember(words).description(""));
    command->callback([arguments, &chosen] {
        chosen = [arguments](Session& session) { return get(*arguments, session); };
    });
}

}  // namespace remesh::client
