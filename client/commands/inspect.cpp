#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/commands.h"
#include "client/formats.h"
#include "client/json.h"
#include "client/tables.h"
#include "client/text.h"
#include "client/transfer.h"

namespace remesh::client {
namespace {

struct InspectArguments {
    std::vector<std::string> inputs;
    std::string input_format;
};

ExitCode inspect(const InspectArguments& arguments, Session& session) {
    v1::InspectArtifactRequest request;
    if (!arguments.input_format.empty()) {
        request.set_format(format_named(arguments.input_format));
    }
    Connection& server = session.any_server();
    for (const std::string& input : arguments.inputs) {
        const InputFile file(input);
        upload(server, file);
        request.set_sha256(file.digest().sha256());
        request.set_file_name(file.name());
        const v1::Inspection inspection = server.inspect(request);
        if (session.settings().json) {
            fmt::print("{}\n", json_line(inspection));
        } else {
            fmt::print("{}", inspection_card(sanitised(input), inspection));
        }
        std::fflush(stdout);
    }
    return ExitCode::Ok;
}

}  // namespace

void add_inspect(CLI::App& app, Action& chosen) {
    CLI::App* command =
        app.add_subcommand("inspect", "Tell what files hold: counts, damage, a good edge length");
    const auto arguments = std::make_shared<InspectArguments>();
    command->add_option("IN", arguments->inputs, "Surfaces to look at; - is stdin")
        ->type_name("FILE")
        ->required();
    command
        ->add_option("--input-format", arguments->input_format,
                     "Format of the input; found from its content if absent")
        ->type_name("FORMAT");
    command->callback([arguments, &chosen] {
        chosen = [arguments](Session& session) { return inspect(*arguments, session); };
    });
}

}  // namespace remesh::client
