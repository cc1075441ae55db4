#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <thread>

#include "server/jobs/codec.h"
#include "server/jobs/registry.h"
#include "server/store/artifact_store.h"
#include "server/store/job_store.h"

namespace remesh {

struct HousekeeperOptions {
    std::chrono::milliseconds lease{30'000};  ///< A worker silent for as long has lost its job.
    std::chrono::seconds keep_uploads = std::chrono::hours(24);  ///< That no job needs.
    std::optional<std::chrono::seconds> keep_jobs{};             ///< Finished ones; absent: ever.
    std::function<void(Time before)> remove_uploads{};  ///< Deletes half ones that rest since then.
};

/// Looks after what nobody holds: takes jobs from workers that are gone, and deletes what is old.
///
/// Whether a worker is silent is measured by this process's own steady clock, from one look at its
/// job's beat to the next: clocks that jump, or that differ between machines, lose no lease.
class Housekeeper {
public:
    using IsAlive = std::function<bool(const std::string& worker)>;
    using SteadyTime = std::chrono::steady_clock::time_point;

    Housekeeper(JobStore& store, ArtifactStore& artifacts, JobRegistry& registry,
                const JobCodec& codec, IsAlive is_alive, const HousekeeperOptions& options);

    /// What a server does before anything runs: dead workers' jobs go back to the queue.
    void take_up(Time now);
    /// Takes the jobs of workers that are dead for two looks (who watches a worker itself comes
    /// first, and knows why it died), or that are silent. \return how many
    int expire(SteadyTime steady, Time now);
    /// Deletes jobs and artifacts that are too old, and what killed processes left.
    void clean_up(Time now);

    /// Does all of it from now on, from a thread of its own.
    void start();

private:
    struct Look {
        std::int64_t epoch = 0;
        std::int64_t beat = 0;
        SteadyTime since{};
        bool was_dead = false;
    };

    void run(const std::stop_token& stop);

    JobStore& store_;
    ArtifactStore& artifacts_;
    JobRegistry& registry_;
    const JobCodec& codec_;
    const IsAlive is_alive_;
    const HousekeeperOptions options_;
    std::map<JobKey, Look> looks_;  // the thread's own once started
    std::jthread thread_;
};

}  // namespace remesh
