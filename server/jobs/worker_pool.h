#pragma once

#include <chrono>
#include <thread>
#include <vector>

#include "server/jobs/engine.h"
#include "server/jobs/lease_desk.h"
#include "server/store/artifact_store.h"

namespace remesh {

struct WorkerOptions {
    int workers = 1;                                       ///< Jobs that run side by side, >= 1.
    int threads = 1;                                       ///< Of each job, >= 1.
    std::chrono::milliseconds checkpoint_interval{5'000};  ///< Between saves of a run's state.
};

/// Threads that claim jobs and run them, each in a TBB arena of its own. Destruction waits until
/// the running jobs have stopped; ask them to by LeaseDesk::drain first.
class WorkerPool {
public:
    WorkerPool(LeaseDesk& desk, ArtifactStore& artifacts, const JobCodec& codec,
               const Engine& engine, const WorkerOptions& options);

private:
    std::vector<std::jthread> threads_;
};

}  // namespace remesh
