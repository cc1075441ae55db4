#include "server/work.h"

#include <spdlog/spdlog.h>
#include <sys/prctl.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <memory>
#include <unistd.h>

#include "server/convert.h"
#include "server/jobs/process_memory.h"
#include "server/jobs/remesh_engine.h"
#include "server/logging.h"
#include "server/machine.h"
#include "server/store/data_dir.h"
#include "server/store/sqlite_job_store.h"

namespace remesh {
namespace {

// A supervisor waits a little longer.
constexpr std::chrono::seconds kShutdownGrace{5};
// What a worker process holds besides its job.
constexpr std::int64_t kProcessBytes = std::int64_t{64} << 20;
constexpr std::int64_t kMiB = std::int64_t{1} << 20;

/// Of a worker process that was started by another one.
struct ChildFlags {
    std::string worker{};
    int parent = 0;
};

/// A worker whose server is gone gives its job back and ends.
void end_with(int parent) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != parent) {
        std::_Exit(EXIT_SUCCESS);  // it was gone before
    }
}

int work(WorkFlags flags, const ChildFlags& child) {
    set_up_log(flags.log_level);
    block_signals();
    complete(flags);
    WorkforceOptions options = workforce_options(flags);
    const bool is_child = !child.worker.empty();
    if (is_child) {
        end_with(child.parent);
        options.desk.worker = child.worker;
        options.desk.max_process_bytes = max_job_bytes(flags) + kProcessBytes;
        options.desk.on_stuck = [] { std::_Exit(EXIT_SUCCESS); };  // The supervisor makes another.
        // Allocations fail before the kernel would choose somebody to kill.
        limit_process_memory(max_job_bytes(flags) / 4 * 5 + 4 * kProcessBytes);
    }
    prepare_data_dir(flags.data_dir);
    const auto store = open_sqlite_store(flags.data_dir / "remesh.sqlite");
    ArtifactStore artifacts(flags.data_dir, *store);
    const WorkerRoster roster(flags.data_dir);
    const ProtoCodec codec;
    const RemeshEngine engine(max_job_bytes(flags), option_rows);
    Workforce workforce(*store, artifacts, roster, codec, engine, options);
    if (!is_child) {
        spdlog::info("event=working workers={} threads={}", flags.workers.workers,
                     flags.workers.threads);
    }
    wait_for_signal();
    workforce.drain();
    if (!workforce.finish(kShutdownGrace)) {
        // A run hangs in code that can't be asked to stop. Its job is back in the queue.
        std::_Exit(EXIT_SUCCESS);
    }
    return EXIT_SUCCESS;
}

}  // namespace

void add_work_flags(CLI::App& command, WorkFlags& flags, int least_workers) {
    command.add_option("--data-dir", flags.data_dir, "Where jobs and artifacts live")->required();
    command.add_option("--workers", flags.workers.workers, "Jobs that run side by side")
        ->check(CLI::Range(least_workers, 256))
        ->capture_default_str();
    command.add_option("--threads", flags.workers.threads, "Threads of each job")
        ->check(CLI::Range(1, 1024))
        ->default_str("the processors, divided among the workers");
    command.add_option("--max-run-time", flags.max_run_time, "Longest time a job may run, seconds")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{31'536'000}))
        ->capture_default_str();
    command.add_option("--max-job-memory", flags.max_job_memory, "Most memory of a job, MiB")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000'000}))
        ->default_str("four fifths of the machine's or cgroup's, divided among the workers");
    command
        .add_option("--tenant-max-running", flags.max_running_of_tenant,
                    "Jobs of one tenant that run side by side")
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000}))
        ->default_str("no limit");
    command
        .add_option("--checkpoint-interval", flags.checkpoint_interval,
                    "Seconds between saves of where a run stands, at least")
        ->check(CLI::Range(0.0, 86'400.0))
        ->capture_default_str();
    command
        .add_option("--worker-process", flags.worker_process,
                    "on: a process for each worker, so that a crash costs one attempt of one job; "
                    "off: threads of this process")
        ->check(CLI::IsMember({"on", "off"}))
        ->capture_default_str();
    command.add_option("--log-level", flags.log_level, "debug, info, warn or error")
        ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
        ->capture_default_str();
}

void complete(WorkFlags& flags) {
    const int workers = std::max(1, flags.workers.workers);
    if (flags.workers.threads == 0) {
        flags.workers.threads = std::max(1, available_processors() / workers);
    }
    if (flags.max_job_memory == 0) {
        flags.max_job_memory =
            std::max<std::int64_t>(64, available_memory() / kMiB * 4 / 5 / workers);
    }
}

std::int64_t max_job_bytes(const WorkFlags& flags) {
    return flags.max_job_memory * kMiB;
}

WorkforceOptions workforce_options(const WorkFlags& flags) {
    WorkforceOptions options;
    options.workers = flags.workers;
    options.workers.checkpoint_interval =
        std::chrono::milliseconds(static_cast<std::int64_t>(flags.checkpoint_interval * 1e3));
    options.desk.max_run_time = std::chrono::seconds(flags.max_run_time);
    options.desk.max_running_of_tenant = flags.max_running_of_tenant;
    if (flags.worker_process == "on") {
        // By this name even if the file was replaced by a newer version meanwhile.
        options.command = {"/proc/self/exe", "work", "--worker-process", "off", "--workers", "1"};
        const auto add = [&](const char* name, const std::string& value) {
            options.command.insert(options.command.end(), {name, value});
        };
        add("--data-dir", flags.data_dir.string());
        add("--threads", std::to_string(flags.workers.threads));
        add("--max-run-time", std::to_string(flags.max_run_time));
        add("--max-job-memory", std::to_string(flags.max_job_memory));
        add("--checkpoint-interval", std::to_string(flags.checkpoint_interval));
        add("--log-level", flags.log_level);
        add("--parent", std::to_string(::getpid()));
        if (flags.max_running_of_tenant) {
            add("--tenant-max-running", std::to_string(*flags.max_running_of_tenant));
        }
    }
    return options;
}

void add_work(CLI::App& app, std::function<int()>& chosen) {
    const auto flags = std::make_shared<WorkFlags>();
    const auto child = std::make_shared<ChildFlags>();
    auto* command =
        app.add_subcommand("work", "Run jobs of a data directory that a server on it takes in");
    add_work_flags(*command, *flags, 1);
    // For processes that are started by this program.
    command->add_option("--worker-id", child->worker)->group("");
    command->add_option("--parent", child->parent)->group("");
    command->callback([flags, child, &chosen] { chosen = [=] { return work(*flags, *child); }; });
}

void block_signals() {
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    std::signal(SIGPIPE, SIG_IGN);
}

int wait_for_signal() {
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    int signal = 0;
    sigwait(&signals, &signal);
    return signal;
}

}  // namespace remesh
