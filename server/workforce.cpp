#include "server/workforce.h"

#include <spdlog/spdlog.h>

#include "server/jobs/losses.h"
#include "server/store/digest.h"

namespace remesh {

/// Workers that are threads of this process.
struct Workforce::Own {
    Own(JobStore& store, ArtifactStore& artifacts, const WorkerRoster& roster,
        const JobCodec& codec, const Engine& engine, const WorkforceOptions& options)
        : entry(roster, options.desk.worker),
          desk(store, artifacts, codec, options.desk),
          pool(desk, artifacts, codec, engine, options.workers) {}

    WorkerEntry entry;
    LeaseDesk desk;
    WorkerPool pool;
};

Workforce::Workforce(JobStore& store, ArtifactStore& artifacts, const WorkerRoster& roster,
                     const JobCodec& codec, const Engine& engine, WorkforceOptions options)
    : store_(store), codec_(codec) {
    if (options.command.empty()) {
        if (options.desk.worker.empty()) {
            options.desk.worker = random_hex(8);
        }
        own_ = std::make_unique<Own>(store, artifacts, roster, codec, engine, options);
    } else {
        supervisor_ = std::make_unique<Supervisor>(
            SupervisorOptions{options.workers.workers, options.command},
            [this](const std::string& worker, WorkerEnd end) { end_worker(worker, end); });
    }
}

Workforce::~Workforce() = default;

void Workforce::end_worker(const std::string& worker, WorkerEnd end) {
    try {
        if (end == WorkerEnd::Killed) {
            give_back_all_of(worker, store_, system_now());
            return;
        }
        const auto cause = end == WorkerEnd::Crashed ? LossCause::Crash : LossCause::Vanished;
        const int lost = lose_all_of(worker, cause, store_, codec_, system_now());
        if (lost > 0) {
            spdlog::warn("event=worker_lost worker={} jobs={}", worker, lost);
        }
    } catch (const StoreError& error) {
        // The housekeeper will find its jobs.
        spdlog::error("event=store_failed worker={} message=\"{}\"", worker, error.what());
    }
}

void Workforce::drain() {
    own_ ? own_->desk.drain() : supervisor_->drain();
}

bool Workforce::finish(std::chrono::milliseconds grace) {
    if (own_) {
        const bool is_idle = own_->desk.wait_until_idle(grace);
        if (!is_idle) {
            own_->desk.surrender();
        }
        return is_idle;
    }
    if (!supervisor_->wait_until_ended(grace)) {
        supervisor_->kill_all();
    }
    return true;
}

}  // namespace remesh
