#include "server/jobs/housekeeper.h"

#include <spdlog/spdlog.h>

#include <condition_variable>
#include <mutex>
#include <utility>

#include "server/jobs/losses.h"

namespace remesh {
namespace {

constexpr std::chrono::seconds kLookInterval{1};
constexpr std::chrono::minutes kCleanInterval{10};
// Of one look for old jobs, so that a flood of them doesn't hold up the rest.
constexpr std::size_t kRemovalsAtOnce = 1'000;

}  // namespace

Housekeeper::Housekeeper(JobStore& store, ArtifactStore& artifacts, JobRegistry& registry,
                         const JobCodec& codec, IsAlive is_alive, const HousekeeperOptions& options)
    : store_(store),
      artifacts_(artifacts),
      registry_(registry),
      codec_(codec),
      is_alive_(std::move(is_alive)),
      options_(options) {}

void Housekeeper::take_up(Time now) {
    for (const JobRecord& job : store_.held()) {
        if (!is_alive_(job.worker)) {
            store_.lose({job.key, job.epoch}, loss_of(job, LossCause::Vanished, codec_, now), now);
            artifacts_.remove_unneeded(job.key.tenant, store_.drop_previews(job.key, {}));
        }
    }
}

int Housekeeper::expire(SteadyTime steady, Time now) {
    int expired = 0;
    std::map<JobKey, Look> seen;
    for (const JobRecord& job : store_.held()) {
        const auto last = looks_.find(job.key);
        const bool is_same = last != looks_.end() && last->second.epoch == job.epoch;
        const bool is_silent = is_same && last->second.beat == job.beat;
        const bool is_dead = !is_alive_(job.worker);
        const Look look{job.epoch, job.beat, is_silent ? last->second.since : steady, is_dead};
        const bool is_over =
            (is_dead && is_same && last->second.was_dead) || steady - look.since >= options_.lease;
        Loss loss = loss_of(job, LossCause::Vanished, codec_, now);
        loss.seen_beat = job.beat;
        if (is_over && store_.lose({job.key, job.epoch}, loss, now)) {
            spdlog::warn("event=lease_lost job={} attempt={} worker={}", job.key.id, job.attempt,
                         job.worker);
            artifacts_.remove_unneeded(job.key.tenant, store_.drop_previews(job.key, {}));
            ++expired;
        } else {
            seen[job.key] = look;
        }
    }
    looks_ = std::move(seen);
    return expired;
}

void Housekeeper::clean_up(Time now) {
    if (options_.keep_jobs) {
        for (const JobKey& key : store_.ended_before(now - *options_.keep_jobs, kRemovalsAtOnce)) {
            try {
                registry_.remove(key, std::nullopt);
                spdlog::info("event=job_deleted job={} reason=retention", key.id);
            } catch (const JobError&) {
                // Somebody else was faster.
            }
        }
    }
    artifacts_.collect_garbage(now - options_.keep_uploads);
    if (options_.remove_uploads) {
        options_.remove_uploads(now - options_.keep_uploads);
    }
}

void Housekeeper::start() {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void Housekeeper::run(const std::stop_token& stop) {
    std::mutex mutex;
    std::condition_variable_any never;
    SteadyTime next_cleaning{};
    while (!stop.stop_requested()) {
        const SteadyTime steady = std::chrono::steady_clock::now();
        try {
            if (expire(steady, system_now()) > 0) {
                next_cleaning = steady;  // the dead leave drafts behind
            }
            if (steady >= next_cleaning) {
                clean_up(system_now());
                next_cleaning = steady + kCleanInterval;
            }
        } catch (const std::exception& error) {
            spdlog::error("event=store_failed message=\"{}\"", error.what());
        }
        std::unique_lock lock(mutex);
        never.wait_for(lock, stop, kLookInterval, [] { return false; });
    }
}

}  // namespace remesh
