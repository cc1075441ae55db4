#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/codec.h"
#include "server/jobs/engine.h"
#include "server/jobs/lease_desk.h"
#include "server/jobs/supervisor.h"
#include "server/jobs/worker_pool.h"
#include "server/store/artifact_store.h"
#include "server/store/job_store.h"
#include "server/store/worker_roster.h"

namespace remesh {

struct WorkforceOptions {
    WorkerOptions workers{};
    DeskOptions desk{};  ///< Without a worker's name: one is made up.
    /// Program and arguments of a worker process; empty: workers are threads of this process.
    std::vector<std::string> command{};
};

/// The workers of one process, wherever they live: threads of its own, or processes that it
/// supervises, so that a job which crashes its worker costs nobody else anything.
class Workforce {
public:
    Workforce(JobStore& store, ArtifactStore& artifacts, const WorkerRoster& roster,
              const JobCodec& codec, const Engine& engine, WorkforceOptions options);
    Workforce(const Workforce&) = delete;
    Workforce& operator=(const Workforce&) = delete;
    ~Workforce();

    /// Takes no more jobs and asks what runs to stop; it goes back to the queue without spending
    /// its attempt.
    void drain();
    /// Waits for that; afterwards gives back what still runs.
    /// \return whether all runs stopped; if not, the process must end without destroying this
    bool finish(std::chrono::milliseconds grace);

private:
    struct Own;

    void end_worker(const std::string& worker, WorkerEnd end);

    JobStore& store_;
    const JobCodec& codec_;
    std::unique_ptr<Own> own_;
    std::unique_ptr<Supervisor> supervisor_;
};

}  // namespace remesh
