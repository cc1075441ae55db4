#pragma once

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "server/workforce.h"

namespace remesh {

/// What `serve` and `work` can be told about running jobs.
struct WorkFlags {
    std::filesystem::path data_dir{};
    WorkerOptions workers{.workers = 1, .threads = 0};  ///< Threads 0: the processors, divided.
    std::int64_t max_run_time =                         ///< Seconds.
        std::chrono::floor<std::chrono::seconds>(DeskOptions{}.max_run_time).count();
    std::int64_t max_job_memory = 0;  ///< MiB; 0: four fifths, divided.
    std::optional<std::int64_t> max_running_of_tenant{};
    double checkpoint_interval =  ///< Seconds.
        std::chrono::duration<double>(WorkerOptions{}.checkpoint_interval).count();
    std::string worker_process = "on";
    std::string log_level = "info";
};

/// \param least_workers  0 for a server that leaves all work to `remeshd work`
void add_work_flags(CLI::App& command, WorkFlags& flags, int least_workers);

/// Fills in what the machine decides.
void complete(WorkFlags& flags);
[[nodiscard]] std::int64_t max_job_bytes(const WorkFlags& flags);
[[nodiscard]] WorkforceOptions workforce_options(const WorkFlags& flags);

/// Adds `remeshd work`; parsing it sets `chosen`.
void add_work(CLI::App& app, std::function<int()>& chosen);

/// Waits for SIGTERM or SIGINT, which `block_signals` must have blocked before any thread began.
int wait_for_signal();
void block_signals();

}  // namespace remesh
