#pragma once

#include <string>

#include "server/jobs/codec.h"
#include "server/store/job_store.h"

namespace remesh {

/// How an attempt came to be lost.
enum class LossCause {
    Crash,     ///< Its worker process died while it ran this job alone.
    Vanished,  ///< Its worker is gone, for whatever reason.
    Storage,   ///< The store didn't take or give its files.
};

inline constexpr int kMaxCrashes = 2;

/// What the store is told about a lost attempt. The first one is made up for at once, later ones
/// wait: 1 s, 4 s, 16 s, at most 5 minutes.
[[nodiscard]] Loss loss_of(const JobRecord& job, LossCause cause, const JobCodec& codec, Time now);

/// Counts what a worker held as lost. \return how many jobs that were
int lose_all_of(const std::string& worker, LossCause cause, JobStore& store, const JobCodec& codec,
                Time now);

/// Gives back what a worker held, as if it hadn't begun. \return how many jobs that were
int give_back_all_of(const std::string& worker, JobStore& store, Time now);

}  // namespace remesh
