#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/commands/commands.h"
#include "client/commands/estimate.h"
#include "client/create_job.h"
#include "client/follow.h"
#include "client/formats.h"
#include "client/json.h"
#include "client/options.h"
#include "client/output_plan.h"
#include "client/progress.h"
#include "client/results.h"
#include "client/tables.h"
#include "client/text.h"

namespace remesh::client {
namespace {

namespace fs = std::filesystem;

/// How long after the first Ctrl-C a second one still cancels the job.
constexpr auto kSecondThoughts = std::chrono::seconds(3);

struct RunArguments {
    JobArguments job;
    OutputWishes wishes;
    std::string report;
};

/// One input on its way through the server.
struct Task {
    InputFile file;
    std::vector<PlannedFile> planned;
    v1::Job job{};
    std::vector<Delivery> deliveries{};
    std::vector<std::string> warnings{};
};

bool is_batch(const RunArguments& arguments) {
    return arguments.job.inputs.size() > 1;
}

void require_consistent(const RunArguments& arguments) {
    if (!is_batch(arguments)) {
        return;
    }
    if (!arguments.wishes.outputs.empty() || !arguments.report.empty()) {
        throw Failure(ExitCode::Usage,
                      "-o and --report are for one input; several inputs want --output-dir and, if "
                      "you like, --format");
    }
}

std::vector<Task> open_inputs(const RunArguments& arguments) {
    std::vector<Task> tasks;
    for (const std::string& input : arguments.job.inputs) {
        tasks.push_back({InputFile(input), {}, {}, {}, {}});
    }
    return tasks;
}

void plan(std::vector<Task>& tasks, const RunArguments& arguments,
          const v1::GetCapabilitiesResponse& server) {
    if (!arguments.wishes.output_dir.empty()) {
        std::error_code error;
        fs::create_directories(arguments.wishes.output_dir, error);
        if (error) {
            throw Failure(ExitCode::Local,
                          fmt::format("can't make the folder {}: {}", arguments.wishes.output_dir,
                                      error.message()));
        }
    }
    std::vector<PlannedFile> all;
    std::vector<fs::path> inputs;
    for (Task& task : tasks) {
        task.planned = plan_outputs(arguments.wishes, arguments.job, task.file.path(), server);
        all.insert(all.end(), task.planned.begin(), task.planned.end());
        inputs.push_back(task.file.path());
    }
    if (!arguments.report.empty()) {
        all.push_back({v1::FORMAT_UNSPECIFIED, arguments.report});
    }
    require_writable(all, inputs);
}

v1::JobSpec spec_for(const RunArguments& arguments, const Task& task) {
    v1::JobSpec spec = arguments.job.spec;
    std::set<v1::Format> formats;
    for (const PlannedFile& file : task.planned) {
        if (formats.insert(file.format).second) {
            spec.add_outputs()->set_format(file.format);
        }
    }
    return spec;
}

/// The server makes jobs, whatever one of a batch is worth: a refusal becomes that job's failure.
void start(Task& task, const RunArguments& arguments, const InputFile* size_image,
           Connection& server) {
    try {
        task.job = create_job(server, {task.file, size_image}, spec_for(arguments, task));
    } catch (const Failure& failure) {
        if (!is_batch(arguments) || failure.code() != ExitCode::BadInput) {
            throw;
        }
        task.job.mutable_spec()->mutable_input()->set_file_name(task.file.name());
        task.job.set_state(v1::Job::STATE_FAILED);
        task.job.mutable_failure()->set_reason("INVALID_INPUT");
        task.job.mutable_failure()->set_message(failure.what());
    }
}

/// Prints what the result's table of defects doesn't say anyway.
void tell_warnings(const Task& task, const Session& session) {
    const auto& defects = task.job.result().quality().defects();
    for (const std::string& warning : task.warnings) {
        const bool is_in_table =
            std::any_of(defects.begin(), defects.end(),
                        [&](const v1::Defect& defect) { return defect.description() == warning; });
        if (!is_in_table) {
            session.note("warning: " + sanitised(warning));
        }
    }
}

/// A job that broke a bound keeps what it made; a mesh that was refused isn't put where a good one
/// was to go.
void deliver_drafts(const Task& task, const RunArguments& arguments, Session& session) {
    if (task.job.failure().outputs().empty()) {
        return;
    }
    Connection& server = session.any_server();
    if (!arguments.report.empty()) {
        deliver(server, {{report_for(task.job, arguments.report), arguments.report}});
        session.note("wrote " + arguments.report);
    }
    if (!session.is_private()) {
        session.note(fmt::format("the server keeps its files: remesh --server {} get {} -o FILE",
                                 server.server(), sanitised(task.job.name())));
    }
}

void finish(Task& task, const RunArguments& arguments, Session& session) {
    Connection& server = session.any_server();
    if (!is_terminal(task.job.state())) {
        ProgressBar progress(is_batch(arguments) ? sanitised(task.file.name()) : "",
                             session.settings());
        task.job = follow(server, task.job.name(), 0, [&](const v1::JobEvent& event) {
            if (event.has_warning()) {
                task.warnings.push_back(event.warning().message());
            }
            progress.apply(event);
        });
    }
    tell_warnings(task, session);
    if (task.job.state() != v1::Job::STATE_SUCCEEDED) {
        deliver_drafts(task, arguments, session);
        return;
    }
    for (const PlannedFile& file : task.planned) {
        task.deliveries.push_back({output_in(task.job, file.format), file.target});
    }
    if (!arguments.report.empty()) {
        task.deliveries.push_back({report_for(task.job, arguments.report), arguments.report});
    }
    deliver(server, task.deliveries);
}

void tell(const Task& task, const RunArguments& arguments, const Session& session) {
    bool uses_stdout = false;
    for (const Delivery& delivery : task.deliveries) {
        uses_stdout = uses_stdout || delivery.target == "-";
    }
    std::FILE* stream = uses_stdout ? stderr : stdout;
    if (session.settings().json) {
        fmt::print(stream, "{}\n", json_line(task.job));
        return;
    }
    if (session.settings().quiet) {
        return;
    }
    const v1::Quality& quality = task.job.result().quality();
    fmt::print(stream, "{}: edge length h = {}{}, {}\n", sanitised(task.file.path().string()),
               number_word(quality.edge_length()),
               arguments.job.spec.options().has_edge_length() ? "" : " (chosen by the server)",
               duration_word(run_seconds(task.job)));
    if (!is_batch(arguments)) {
        fmt::print(stream, "\n{}\n", quality_table(quality));
    }
    fmt::print(stream, "wrote {}\n", delivery_words(task.deliveries));
    std::fflush(stream);
}

/// After Ctrl-C with a named server: the jobs go on, unless a second Ctrl-C says otherwise.
[[noreturn]] void detach(const std::vector<Task>& tasks, Session& session) {
    Connection& server = session.any_server();
    std::vector<std::string> names;
    for (const Task& task : tasks) {
        if (!task.job.name().empty() && !is_terminal(task.job.state())) {
            names.push_back(task.job.name());
        }
    }
    if (names.empty()) {
        throw Failure(ExitCode::Interrupted, "interrupted; nothing was written");
    }
    fmt::print(stderr, "\nThe job goes on. Follow it, and fetch what it makes, with\n");
    for (const std::string& name : names) {
        fmt::print(stderr, "  remesh --server {} watch {}\n", server.server(), sanitised(name));
    }
    fmt::print(stderr, "Press Ctrl-C again within {} s to cancel it.\n", kSecondThoughts.count());

    std::mutex mutex;
    std::condition_variable_any never;
    std::unique_lock lock(mutex);
    never.wait_for(lock, session.interrupts().second(), kSecondThoughts, [] { return false; });
    if (!session.interrupts().second().stop_requested()) {
        throw Failure(ExitCode::Interrupted, "detached; nothing was written");
    }
    server.set_stop({});
    for (const std::string& name : names) {
        static_cast<void>(server.cancel_job(name));
    }
    throw Failure(ExitCode::Interrupted, "interrupted, and the job was cancelled");
}

ExitCode run_tasks(std::vector<Task>& tasks, const RunArguments& arguments,
                   const InputFile* size_image, Session& session) {
    for (Task& task : tasks) {
        start(task, arguments, size_image, session.any_server());
    }
    ExitCode code = ExitCode::Ok;
    for (Task& task : tasks) {
        finish(task, arguments, session);
        if (!is_batch(arguments)) {
            require_success(task.job);
        }
        if (task.job.state() == v1::Job::STATE_SUCCEEDED) {
            tell(task, arguments, session);
            continue;
        }
        fmt::print(stderr, "remesh: {}: {}\n", sanitised(task.file.path().string()),
                   reason_of(task.job));
        code = code == ExitCode::Ok ? exit_code_of(task.job) : code;
    }
    return code;
}

ExitCode run(const RunArguments& arguments, Session& session) {
    require_consistent(arguments);
    if (!session.is_private() && session.settings().own_server.threads > 0) {
        session.note("--threads is for a private server; the named one has its own");
    }
    std::vector<Task> tasks = open_inputs(arguments);
    const std::optional<InputFile> opened = open_size_image(arguments.job);
    const InputFile* size_image = opened ? &*opened : nullptr;
    plan(tasks, arguments, session.any_server().capabilities());
    ExitCode code = ExitCode::Ok;
    if (arguments.job.wants_estimate) {
        for (const Task& task : tasks) {
            tell_estimate({task.file, size_image}, spec_for(arguments, task), session.any_server(),
                          session.settings());
        }
        return code;
    }
    try {
        code = run_tasks(tasks, arguments, size_image, session);
    } catch (const Failure& failure) {
        if (failure.code() != ExitCode::Interrupted) {
            throw;
        }
        if (session.is_private()) {
            throw Failure(ExitCode::Interrupted, "interrupted; nothing was written");
        }
        detach(tasks, session);
    }
    if (is_batch(arguments) && !session.settings().json && !session.settings().quiet) {
        std::vector<v1::Job> jobs;
        for (const Task& task : tasks) {
            jobs.push_back(task.job);
        }
        fmt::print("\n{}", batch_table(jobs));
    }
    return code;
}

}  // namespace

void add_run(CLI::App& app, Action& chosen) {
    CLI::App* command =
        app.add_subcommand("run", "Remesh surfaces: upload, follow, download, and compare");
    const auto arguments = std::make_shared<RunArguments>();
    command
        ->add_option("-o,--output", arguments->wishes.outputs,
                     "File to write, its format by extension; - is stdout (repeatable)")
        ->type_name("FILE")
        ->allow_extra_args(false);
    command
        ->add_option("--output-dir", arguments->wishes.output_dir,
                     "Folder for IN_remeshed.EXT, made if need be")
        ->type_name("FOLDER");
    command
        ->add_option("--report", arguments->report,
                     "Also write the full report: a page if FILE ends in .html, else JSON")
        ->type_name("FILE");
    add_job_arguments(*command, arguments->job);
    command->callback([arguments, &chosen] {
        chosen = [arguments](Session& session) { return run(*arguments, session); };
    });
    command->footer(
        "Without -o it writes IN_remeshed.vtu (tets) and IN_remeshed.ply (surface) here.\n"
        "Without --server it starts a private server, and stops it at the end.\n"
        "Defaults of the options: remesh capabilities; global options: remesh --help\n"
        "\n"
        "Examples:\n"
        "  remesh run aorta.stl --edge-length 1.2 -o aorta.vtu -o aorta.ply\n"
        "  remesh run heart.ply --surface-only -o - --format stl > heart.stl\n"
        "  remesh run scans/*.stl --output-dir meshes --format msh41");
}

}  // namespace remesh::client
