#include "server/jobs/lease_desk.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/jobs/losses.h"
#include "server/jobs/process_memory.h"

namespace remesh {
namespace {

// Workers look at the queue this often even if nobody wakes them: a job's retry time may have come.
constexpr std::chrono::milliseconds kPollInterval{1'000};
constexpr std::chrono::seconds kPause{5};

using SteadyTime = std::chrono::steady_clock::time_point;

}  // namespace

LeaseDesk::LeaseDesk(JobStore& store, ArtifactStore& artifacts, const JobCodec& codec,
                     const DeskOptions& options, Clock clock)
    : store_(store),
      artifacts_(artifacts),
      codec_(codec),
      options_(options),
      clock_(clock ? std::move(clock) : system_now) {
    tender_ = std::jthread([this](const std::stop_token& stop) { tend(stop); });
    listener_ = std::jthread([this, feed = std::shared_ptr(store_.follow())](
                                 const std::stop_token& stop) { listen(stop, *feed); });
}

LeaseDesk::~LeaseDesk() = default;

std::unique_ptr<Lease> LeaseDesk::claim(const std::stop_token& stop) {
    while (true) {
        std::unique_lock lock(mutex_);
        if (stop.stop_requested() || is_draining_) {
            return nullptr;
        }
        const std::uint64_t seen = work_signals_;
        lock.unlock();
        {
            const std::scoped_lock claim_lock(claim_mutex_);
            const auto job =
                store_.claim({options_.worker, options_.max_running_of_tenant}, clock_());
            if (job) {
                return admit(*job);
            }
        }
        lock.lock();
        work_.wait(lock, stop, [&] { return work_signals_ != seen || is_draining_; });
    }
}

std::unique_ptr<Lease> LeaseDesk::admit(const JobRecord& job) {
    const auto asked = codec_.decode_spec(job.spec).timeout;
    const auto limit = std::min<std::chrono::milliseconds>(
        asked.value_or(std::chrono::hours(24 * 365)), options_.max_run_time);
    const SteadyTime now = std::chrono::steady_clock::now();
    auto attempt = std::make_shared<Attempt>();
    attempt->job = job;
    attempt->deadline = now + limit;
    attempt->next_beat = now + options_.beat_interval;
    const std::scoped_lock lock(mutex_);
    if (is_draining_) {
        stop_for(*attempt, Attempt::StopReason::Drain);
    }
    running_[job.key] = attempt;
    ++leases_;
    attempts_.notify_all();
    return std::make_unique<Lease>(*this, std::move(attempt));
}

bool LeaseDesk::pause(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    return !work_.wait_for(lock, stop, kPause, [this] { return is_draining_; }) &&
           !stop.stop_requested();
}

void LeaseDesk::drain() {
    const std::scoped_lock lock(mutex_);
    is_draining_ = true;
    for (auto& [key, attempt] : running_) {
        stop_for(*attempt, Attempt::StopReason::Drain);
    }
    work_.notify_all();
}

bool LeaseDesk::wait_until_idle(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    return attempts_.wait_for(lock, timeout, [this] { return running_.empty() && leases_ == 0; });
}

void LeaseDesk::surrender() {
    const auto attempts = [this] {
        const std::scoped_lock lock(mutex_);
        return running_;
    }();
    for (const auto& [key, attempt] : attempts) {
        end(*attempt, [this](const Claim& claim) { return store_.give_back(claim, clock_()); });
    }
}

std::string LeaseDesk::memory_limit_passed() const {
    return "The job needed more memory than the server's limit, " +
           std::to_string(options_.max_process_bytes.value_or(0) >> 20U) +
           " MiB; a larger edge_length needs less.";
}

std::optional<Settlement> LeaseDesk::failure_of(Attempt::StopReason reason, Stage stage) const {
    const auto failure = [&]() -> std::optional<JobFailure> {
        switch (reason) {
            case Attempt::StopReason::Timeout:
                return JobFailure{"TIMEOUT", "The job ran longer than its time limit.", false,
                                  stage};
            case Attempt::StopReason::Memory:
                return JobFailure{"TOO_LARGE", memory_limit_passed(), false, stage};
            case Attempt::StopReason::None:
                return JobFailure{"INTERNAL", "The run stopped although nobody asked it to.", true,
                                  stage};
            case Attempt::StopReason::Cancel:
            case Attempt::StopReason::Drain:
            case Attempt::StopReason::Void: break;
        }
        return std::nullopt;
    }();
    if (!failure) {
        return std::nullopt;
    }
    return Settlement{.state = JobState::Failed, .outcome = codec_.encode_failure(*failure)};
}

void LeaseDesk::stop_for(Attempt& attempt, Attempt::StopReason reason) {
    if (attempt.stop_reason == Attempt::StopReason::None) {
        attempt.stop_reason = reason;
    }
    if (!attempt.stop_time) {
        attempt.stop_time = std::chrono::steady_clock::now();
    }
    attempt.stop.request_stop();
}

void LeaseDesk::obey(Attempt& attempt, std::optional<JobState> state) {
    if (state != JobState::Running) {
        const std::scoped_lock lock(mutex_);
        stop_for(attempt, state == JobState::Cancelling ? Attempt::StopReason::Cancel
                                                        : Attempt::StopReason::Void);
    }
}

// Hears what others do: new jobs wake workers, cancelled ones stop.
void LeaseDesk::listen(const std::stop_token& stop, ChangeFeed& feed) {
    while (!stop.stop_requested()) {
        try {
            for (const JobKey& key : feed.next(kPollInterval, stop)) {
                const auto attempt = [&]() -> std::shared_ptr<Attempt> {
                    const std::scoped_lock lock(claim_mutex_, mutex_);
                    const auto found = running_.find(key);
                    return found == running_.end() ? nullptr : found->second;
                }();
                const auto job = attempt ? store_.find(key) : std::nullopt;
                if (job && job->state == JobState::Cancelling) {
                    obey(*attempt, job->state);
                }
            }
        } catch (const StoreError& error) {
            spdlog::error("event=store_failed message=\"{}\"", error.what());
            pause(stop);
        }
        const std::scoped_lock lock(mutex_);
        ++work_signals_;
        work_.notify_all();
    }
}

// Flushes events, renews leases and ends what exceeds its limits, while anything runs.
void LeaseDesk::tend(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
        {
            std::unique_lock lock(mutex_);
            if (!attempts_.wait(lock, stop, [&] { return !running_.empty(); })) {
                return;
            }
            attempts_.wait_for(lock, stop, options_.flush_interval, [] { return false; });
        }
        const Attempts attempts = look_at_limits();
        for (const auto& attempt : attempts) {
            try {
                flush(*attempt, {}, {});
            } catch (const StoreError&) {
                // The events stay where they are, and the verdict will meet the same trouble.
            }
        }
        beat(attempts);
        lose_abandoned();
        end_stuck(attempts);
    }
}

LeaseDesk::Attempts LeaseDesk::look_at_limits() {
    const bool is_too_large =
        options_.max_process_bytes && resident_bytes() > *options_.max_process_bytes;
    const SteadyTime now = std::chrono::steady_clock::now();
    Attempts attempts;
    const std::scoped_lock lock(mutex_);
    for (auto& [key, attempt] : running_) {
        if (is_too_large) {
            stop_for(*attempt, Attempt::StopReason::Memory);
        } else if (now >= attempt->deadline) {
            stop_for(*attempt, Attempt::StopReason::Timeout);
        }
        attempts.push_back(attempt);
    }
    return attempts;
}

void LeaseDesk::beat(const Attempts& attempts) {
    const SteadyTime now = std::chrono::steady_clock::now();
    for (const auto& attempt : attempts) {
        if (now < attempt->next_beat) {
            continue;
        }
        attempt->next_beat = now + options_.beat_interval;
        try {
            obey(*attempt, store_.renew({attempt->job.key, attempt->job.epoch}));
        } catch (const StoreError& error) {
            spdlog::error("event=store_failed message=\"{}\"", error.what());
        }
    }
}

void LeaseDesk::lose_abandoned() {
    Attempts abandoned;
    {
        const std::scoped_lock lock(mutex_);
        for (auto& [key, attempt] : running_) {
            if (attempt->is_abandoned) {
                abandoned.push_back(attempt);
            }
        }
    }
    for (const auto& attempt : abandoned) {
        lose(*attempt);
    }
}

// Their threads may hang in code that never looks whether it shall stop; what they write later is
// void.
void LeaseDesk::end_stuck(const Attempts& attempts) {
    for (const auto& attempt : attempts) {
        if (is_stuck(*attempt) && settle_without(*attempt)) {
            spdlog::error("event=run_stuck job={} attempt={}", attempt->job.key.id,
                          attempt->job.attempt);
            if (options_.on_stuck) {
                options_.on_stuck();
            }
        }
    }
}

bool LeaseDesk::is_stuck(const Attempt& attempt) {
    const std::scoped_lock lock(mutex_);
    const auto found = running_.find(attempt.job.key);
    const bool is_running = found != running_.end() && found->second.get() == &attempt;
    // Who drains has a grace of its own.
    return is_running && !attempt.is_abandoned && attempt.stop_time &&
           attempt.stop_reason != Attempt::StopReason::Drain &&
           std::chrono::steady_clock::now() - *attempt.stop_time >= options_.stop_grace;
}

bool LeaseDesk::settle_without(Attempt& attempt) {
    auto reason = Attempt::StopReason::None;
    std::optional<Settlement> failure;
    {
        const std::scoped_lock lock(mutex_);
        reason = attempt.stop_reason;
        failure = failure_of(reason, attempt.stage);
    }
    try {
        const auto job = end(attempt, [&](const Claim& claim) {
            return failure ? store_.settle(claim, *failure, clock_())
                           : store_.give_back(claim, clock_());
        });
        if (!job && reason != Attempt::StopReason::Void) {
            return false;  // The run was faster, after all.
        }
    } catch (const StoreError& error) {
        spdlog::error("event=store_failed job={} message=\"{}\"", attempt.job.key.id, error.what());
        const std::scoped_lock lock(mutex_);
        attempt.is_abandoned = false;  // The same verdict is tried again.
        return false;
    }
    try {
        drop_previews(attempt.job.key, {});
    } catch (const StoreError& error) {
        spdlog::error("event=store_failed job={} message=\"{}\"", attempt.job.key.id, error.what());
    }
    return true;
}

void LeaseDesk::flush(Attempt& attempt, const std::vector<NewEvent>& more,
                      const std::vector<ArtifactId>& previews) {
    const std::scoped_lock flush_lock(attempt.flush_mutex);
    std::vector<NewEvent> events;
    {
        const std::scoped_lock lock(mutex_);
        events = attempt.pending;
    }
    const std::size_t taken = events.size();
    events.insert(events.end(), more.begin(), more.end());
    if (events.empty()) {
        return;
    }
    const Claim claim{attempt.job.key, attempt.job.epoch};
    const bool is_held = store_.append(claim, events, previews, clock_()).has_value();
    const std::scoped_lock lock(mutex_);
    attempt.pending.erase(attempt.pending.begin(),
                          attempt.pending.begin() + static_cast<std::ptrdiff_t>(taken));
    if (!is_held) {
        stop_for(attempt, Attempt::StopReason::Void);
    }
}

std::optional<JobRecord> LeaseDesk::end(Attempt& attempt, const Verdict& verdict) {
    std::optional<JobRecord> job;
    try {
        flush(attempt, {}, {});
        job = verdict({attempt.job.key, attempt.job.epoch});
    } catch (const StoreError&) {
        const std::scoped_lock lock(mutex_);
        attempt.is_abandoned = true;
        throw;
    }
    const std::scoped_lock lock(mutex_);
    const auto found = running_.find(attempt.job.key);
    if (found != running_.end() && found->second.get() == &attempt) {
        running_.erase(found);
        attempts_.notify_all();
    }
    return job;
}

void LeaseDesk::lose(Attempt& attempt) {
    try {
        end(attempt, [&](const Claim& claim) {
            const Time now = clock_();
            return store_.lose(claim, loss_of(attempt.job, LossCause::Vanished, codec_, now), now);
        });
        drop_previews(attempt.job.key, {});
    } catch (const StoreError& error) {
        // The tender tries again.
        spdlog::error("event=store_failed job={} message=\"{}\"", attempt.job.key.id, error.what());
    }
}

void LeaseDesk::drop_previews(const JobKey& key, std::span<const std::string> keep) {
    artifacts_.remove_unneeded(key.tenant, store_.drop_previews(key, keep));
}

}  // namespace remesh
