#include "server/jobs/losses.h"

#include <algorithm>
#include <chrono>

namespace remesh {
namespace {

std::chrono::seconds wait_after(int attempt) {
    constexpr std::chrono::seconds longest = std::chrono::minutes(5);
    std::chrono::seconds wait(attempt < 2 ? 0 : 1);
    for (int i = 2; i < attempt && wait < longest; ++i) {
        wait *= 4;
    }
    return std::min(wait, longest);
}

JobFailure failure_of(const JobRecord& job, LossCause cause) {
    const std::string times = std::to_string(job.attempt) + " times";
    switch (cause) {
        case LossCause::Crash:
            return {"WORKER_LOST",
                    "It crashed its worker " + std::to_string(job.crashes + 1) +
                        " times, so the job isn't tried again.",
                    false, Stage::Read};
        case LossCause::Vanished:
            return {"WORKER_LOST",
                    "Its worker was lost " + times + ", so the job isn't tried again.", false,
                    Stage::Read};
        case LossCause::Storage:
            return {"STORAGE", "The server's disk didn't take the job's files " + times + ".", true,
                    Stage::Write};
    }
    return {};
}

}  // namespace

Loss loss_of(const JobRecord& job, LossCause cause, const JobCodec& codec, Time now) {
    Loss loss;
    loss.is_crash = cause == LossCause::Crash;
    loss.max_crashes = kMaxCrashes;
    loss.last_state = cause == LossCause::Storage ? JobState::Failed : JobState::Quarantined;
    loss.outcome = codec.encode_failure(failure_of(job, cause));
    loss.retry_time = now + wait_after(job.attempt);
    return loss;
}

int lose_all_of(const std::string& worker, LossCause cause, JobStore& store, const JobCodec& codec,
                Time now) {
    int lost = 0;
    for (const JobRecord& job : store.held()) {
        if (job.worker == worker &&
            store.lose({job.key, job.epoch}, loss_of(job, cause, codec, now), now)) {
            ++lost;
        }
    }
    return lost;
}

int give_back_all_of(const std::string& worker, JobStore& store, Time now) {
    int given = 0;
    for (const JobRecord& job : store.held()) {
        if (job.worker == worker && store.give_back({job.key, job.epoch}, now)) {
            ++given;
        }
    }
    return given;
}

}  // namespace remesh
