// The commands for jobs that are there: list, show, cancel, retry, delete.

#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/commands.h"
#include "client/create_job.h"
#include "client/json.h"
#include "client/tables.h"
#include "client/text.h"

namespace remesh::client {
namespace {

struct ListArguments {
    std::vector<std::string> states;
    int most = 0;  ///< 0: all.
};

struct NameArguments {
    std::vector<std::string> names;
};

v1::Job::State state_named(const std::string& word) {
    v1::Job::State state = v1::Job::STATE_UNSPECIFIED;
    std::string upper;
    for (const char c : word) {
        upper += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    }
    if (!v1::Job::State_Parse("STATE_" + upper, &state)) {
        throw Failure(ExitCode::Usage, fmt::format("no state is called {}", sanitised(word)));
    }
    return state;
}

ExitCode list_jobs(const ListArguments& arguments, Session& session) {
    v1::ListJobsRequest request;
    for (const std::string& word : arguments.states) {
        request.add_states(state_named(word));
    }
    Connection& server = session.named_server();
    std::vector<v1::Job> jobs;
    const auto is_enough = [&] {
        return arguments.most > 0 && jobs.size() >= static_cast<std::size_t>(arguments.most);
    };
    do {
        const v1::ListJobsResponse page = server.list_jobs(request);
        for (const v1::Job& job : page.jobs()) {
            if (is_enough()) {
                break;
            }
            if (session.settings().json) {
                fmt::print("{}\n", json_line(job));
            }
            jobs.push_back(job);
        }
        request.set_page_token(page.next_page_token());
    } while (!request.page_token().empty() && !is_enough());
    if (!session.settings().json) {
        fmt::print("{}", jobs_table(jobs));
    }
    return ExitCode::Ok;
}

ExitCode show_jobs(const NameArguments& arguments, Session& session) {
    for (const std::string& name : arguments.names) {
        const v1::Job job = session.named_server().get_job(name);
        fmt::print("{}", session.settings().json ? json_line(job) + "\n" : job_card(job));
    }
    return ExitCode::Ok;
}

ExitCode cancel_jobs(const NameArguments& arguments, Session& session) {
    for (const std::string& name : arguments.names) {
        const v1::Job job = session.named_server().cancel_job(name);
        if (session.settings().json) {
            fmt::print("{}\n", json_line(job));
        } else {
            session.note(fmt::format("{} is {}", sanitised(job.name()), state_word(job.state())));
        }
    }
    return ExitCode::Ok;
}

ExitCode retry_jobs(const NameArguments& arguments, Session& session) {
    for (const std::string& name : arguments.names) {
        const v1::Job job = retry_job(session.named_server(), name);
        fmt::print("{}\n", session.settings().json ? json_line(job) : sanitised(job.name()));
        std::fflush(stdout);  // Jobs that exist are known even if a later one is refused.
    }
    return ExitCode::Ok;
}

ExitCode delete_jobs(const NameArguments& arguments, Session& session) {
    for (const std::string& name : arguments.names) {
        session.named_server().delete_job(name);
        session.note(fmt::format("{} is deleted", sanitised(name)));
    }
    return ExitCode::Ok;
}

void add_named(CLI::App& app, Action& chosen, const std::string& word, const std::string& help,
               ExitCode (*action)(const NameArguments&, Session&)) {
    CLI::App* command = app.add_subcommand(word, help);
    const auto arguments = std::make_shared<NameArguments>();
    command->add_option("JOB", arguments->names, "Names as printed by submit and list")
        ->type_name("NAME")
        ->required();
    command->callback([arguments, action, &chosen] {
        chosen = [arguments, action](Session& session) { return action(*arguments, session); };
    });
}

}  // namespace

void add_list(CLI::App& app, Action& chosen) {
    CLI::App* command = app.add_subcommand("list", "List jobs, newest first");
    const auto arguments = std::make_shared<ListArguments>();
    command->add_option("--state", arguments->states, "Only jobs in this state (repeatable)")
        ->type_name("STATE")
        ->allow_extra_args(false);
    command->add_option("--most", arguments->most, "At most this many")
        ->type_name("N")
        ->check(CLI::Validator(CLI::PositiveNumber).description(""));
    command->callback([arguments, &chosen] {
        chosen = [arguments](Session& session) { return list_jobs(*arguments, session); };
    });
}

void add_show(CLI::App& app, Action& chosen) {
    add_named(app, chosen, "show", "Show jobs with their options, outputs and quality", show_jobs);
}

void add_cancel(CLI::App& app, Action& chosen) {
    add_named(app, chosen, "cancel", "Ask jobs to stop", cancel_jobs);
}

void add_retry(CLI::App& app, Action& chosen) {
    add_named(app, chosen, "retry",
              "Run failed, cancelled or quarantined jobs again, and print the new jobs' names",
              retry_jobs);
}

void add_delete(CLI::App& app, Action& chosen) {
    add_named(app, chosen, "delete", "Delete finished jobs and their files", delete_jobs);
}

}  // namespace remesh::client
