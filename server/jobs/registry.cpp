#include "server/jobs/registry.h"

#include <algorithm>
#include <utility>

namespace remesh {
namespace {

// Previews of a running attempt that stay visible.
constexpr std::size_t kPreviewsKept = 8;
// Workers look at the queue this often even if nobody wakes them.
constexpr std::chrono::seconds kPollInterval{5};

EventKind kind_of(const JobEventBody& event) {
    constexpr EventKind kinds[]{EventKind::Progress, EventKind::Sample, EventKind::Warning,
                                EventKind::Preview};
    return kinds[event.index()];
}

std::string summary_of(const std::vector<FieldProblem>& problems) {
    std::string text;
    for (const FieldProblem& problem : problems) {
        text += (text.empty() ? "" : "; ") + problem.message;
    }
    return text;
}

}  // namespace

JobError::JobError(std::vector<FieldProblem> problems)
    : std::runtime_error(summary_of(problems)),
      code_(JobErrorCode::BadRequest),
      problems_(std::move(problems)) {}

// Lease

Lease::Lease(JobRegistry& registry, std::shared_ptr<Attempt> attempt)
    : registry_(registry), attempt_(std::move(attempt)) {}

Lease::~Lease() {
    if (!is_settled_) {
        registry_.lose(*attempt_);
    }
}

void Lease::publish(const JobEventBody& event) {
    NewEvent stored{kind_of(event), registry_.clock_(), registry_.codec_.encode_event(event)};
    const std::scoped_lock lock(registry_.mutex_);
    if (const auto* progress = std::get_if<Progress>(&event)) {
        attempt_->progress = *progress;
    }
    attempt_->pending.push_back(std::move(stored));
}

void Lease::publish_preview(ArtifactDraft draft, int iteration) {
    const ArtifactId artifact = draft.finish();
    const JobEventBody body = StoredPreview{artifact, iteration};
    std::vector<ArtifactDraft> drafts;
    drafts.push_back(std::move(draft));
    registry_.artifacts_.publish(std::move(drafts), [&] {
        registry_.flush(
            *attempt_,
            {{EventKind::Preview, registry_.clock_(), registry_.codec_.encode_event(body)}},
            {artifact});
    });
    previews_.push_back(artifact.sha256);
    if (previews_.size() > kPreviewsKept) {
        previews_.pop_front();
        const std::vector<std::string> keep(previews_.begin(), previews_.end());
        registry_.drop_previews(job().key, keep);
    }
}

std::optional<JobState> Lease::succeed(const JobResult& result,
                                       std::vector<ArtifactDraft> outputs) {
    Settlement settlement{JobState::Succeeded, registry_.codec_.encode_result(job().spec, result)};
    for (const JobOutput& output : result.outputs) {
        settlement.outputs.push_back(output.artifact);
    }
    std::optional<JobRecord> job;
    registry_.artifacts_.publish(std::move(outputs), [&] {
        job = registry_.end(*attempt_, [&](const Claim& claim) {
            return registry_.store_.settle(claim, settlement, registry_.clock_());
        });
    });
    is_settled_ = true;
    if (!previews_.empty()) {
        registry_.drop_previews(this->job().key, {});
    }
    return job ? std::optional(job->state) : std::nullopt;
}

std::optional<JobState> Lease::fail(const JobFailure& failure, std::vector<ArtifactDraft> outputs) {
    Settlement settlement{JobState::Failed, registry_.codec_.encode_failure(failure)};
    for (const JobOutput& output : failure.outputs) {
        settlement.outputs.push_back(output.artifact);
    }
    std::optional<JobRecord> job;
    registry_.artifacts_.publish(std::move(outputs), [&] {
        job = registry_.end(*attempt_, [&](const Claim& claim) {
            return registry_.store_.settle(claim, settlement, registry_.clock_());
        });
    });
    is_settled_ = true;
    if (!previews_.empty()) {
        registry_.drop_previews(this->job().key, {});
    }
    return job ? std::optional(job->state) : std::nullopt;
}

std::optional<JobState> Lease::stopped(Stage stage) {
    const auto reason = [&] {
        const std::scoped_lock lock(registry_.mutex_);
        return attempt_->stop_reason;
    }();
    switch (reason) {
        case Attempt::StopReason::Timeout:
            return fail({"TIMEOUT", "The job ran longer than its time limit.", false, stage});
        case Attempt::StopReason::None:
            return fail({"INTERNAL", "The run stopped although nobody asked it to.", true, stage});
        case Attempt::StopReason::Cancel:
        case Attempt::StopReason::Drain: break;
    }
    const auto job = registry_.end(*attempt_, [&](const Claim& claim) {
        return registry_.store_.give_back(claim, registry_.clock_());
    });
    is_settled_ = true;
    if (!previews_.empty()) {
        registry_.drop_previews(this->job().key, {});
    }
    return job ? std::optional(job->state) : std::nullopt;
}

// JobRegistry

JobRegistry::JobRegistry(JobStore& store, ArtifactStore& artifacts, const JobCodec& codec,
                         const Engine& engine, const RegistryOptions& options, Clock clock)
    : store_(store),
      artifacts_(artifacts),
      codec_(codec),
      engine_(engine),
      options_(options),
      clock_(clock ? std::move(clock) : system_now) {
    take_up();
    tender_ = std::jthread([this](std::stop_token stop) { tend(std::move(stop)); });
}

JobRegistry::~JobRegistry() = default;

void JobRegistry::set_listener(Listener listener) {
    listener_ = std::move(listener);
}

JobView JobRegistry::submit(const Submission& submission) {
    if (is_draining()) {
        throw JobError(JobErrorCode::ShuttingDown, "the server is shutting down");
    }
    const JobRequest request = codec_.decode_spec(submission.spec);
    if (auto problems = engine_.check(request); !problems.empty()) {
        throw JobError(std::move(problems));
    }
    NewJob job{{submission.tenant, random_hex(10)},
               submission.request_id,
               submission.spec,
               request.priority,
               options_.max_attempts,
               {request.input.sha256}};
    if (submission.validate_only) {
        if (!artifacts_.find(submission.tenant, request.input.sha256)) {
            throw JobError(JobErrorCode::MissingInput, "the input artifact isn't there",
                           request.input.sha256);
        }
        JobView view;
        view.job.spec = submission.spec;
        view.job.priority = request.priority;
        view.job.max_attempts = options_.max_attempts;
        return view;
    }
    auto creation = store_.create(job, options_.max_queued, clock_());
    switch (creation.verdict) {
        case Creation::Verdict::Created: wake_workers(); break;
        case Creation::Verdict::Repeated: break;
        case Creation::Verdict::Conflict:
            throw JobError(JobErrorCode::RequestIdReused,
                           "request_id was used before with another spec", submission.request_id);
        case Creation::Verdict::QueueFull:
            throw JobError(JobErrorCode::LimitPassed,
                           "the queue is full: at most " + std::to_string(options_.max_queued) +
                               " jobs may wait",
                           "queue");
        case Creation::Verdict::MissingInput:
            throw JobError(JobErrorCode::MissingInput, "the input artifact isn't there",
                           creation.missing);
    }
    return view_of(std::move(*creation.job));
}

JobView JobRegistry::get(const JobKey& key) {
    auto job = store_.find(key);
    if (!job) {
        throw JobError(JobErrorCode::NotFound, "there is no such job", key.id);
    }
    return view_of(std::move(*job));
}

std::vector<JobView> JobRegistry::list(const ListQuery& query) {
    std::vector<JobView> views;
    for (JobRecord& job : store_.list(query)) {
        views.push_back(view_of(std::move(job)));
    }
    return views;
}

std::vector<StoredEvent> JobRegistry::events_after(const JobKey& key, std::int64_t sequence,
                                                   std::size_t limit) {
    return store_.events_after(key, sequence, limit);
}

JobView JobRegistry::cancel(const JobKey& key) {
    auto job = store_.request_cancel(key, clock_());
    if (!job) {
        throw JobError(JobErrorCode::NotFound, "there is no such job", key.id);
    }
    if (job->state == JobState::Cancelling) {
        const std::scoped_lock lock(claim_mutex_, mutex_);
        if (const auto found = running_.find(key); found != running_.end()) {
            found->second->stop_reason = Attempt::StopReason::Cancel;
            found->second->stop.request_stop();
        }
    }
    notify(key);
    return view_of(std::move(*job));
}

void JobRegistry::remove(const JobKey& key, std::optional<std::int64_t> revision) {
    std::vector<std::string> artifacts;
    switch (store_.remove(key, revision, &artifacts)) {
        case JobStore::Removal::Removed: break;
        case JobStore::Removal::NotFound:
            throw JobError(JobErrorCode::NotFound, "there is no such job", key.id);
        case JobStore::Removal::NotTerminal:
            throw JobError(JobErrorCode::NotTerminal, "the job is still queued or running", key.id);
        case JobStore::Removal::OtherRevision:
            throw JobError(JobErrorCode::Changed, "the job has changed since that etag", key.id);
    }
    artifacts_.remove_unneeded(key.tenant, artifacts);
    notify(key);
}

std::unique_ptr<Lease> JobRegistry::claim(std::stop_token stop) {
    while (true) {
        std::unique_lock lock(mutex_);
        if (stop.stop_requested() || is_draining_) {
            return nullptr;
        }
        const std::uint64_t seen = work_signals_;
        lock.unlock();

        {
            const std::scoped_lock claim_lock(claim_mutex_);
            if (auto job = store_.claim(clock_())) {
                const auto asked = codec_.decode_spec(job->spec).timeout;
                const auto limit = std::min<std::chrono::milliseconds>(
                    asked.value_or(std::chrono::hours(24 * 365)), options_.max_run_time);
                auto attempt = std::make_shared<Attempt>();
                attempt->job = *job;
                attempt->deadline = std::chrono::steady_clock::now() + limit;
                lock.lock();
                if (is_draining_) {
                    attempt->stop_reason = Attempt::StopReason::Drain;
                    attempt->stop.request_stop();
                }
                running_[job->key] = attempt;
                attempts_.notify_all();
                lock.unlock();
                notify(job->key);
                return std::make_unique<Lease>(*this, std::move(attempt));
            }
        }
        lock.lock();
        work_.wait_for(lock, stop, kPollInterval,
                       [&] { return work_signals_ != seen || is_draining_; });
    }
}

bool JobRegistry::pause(std::stop_token stop) {
    std::unique_lock lock(mutex_);
    return !work_.wait_for(lock, stop, kPollInterval, [this] { return is_draining_; }) &&
           !stop.stop_requested();
}

void JobRegistry::drain() {
    const std::scoped_lock lock(mutex_);
    is_draining_ = true;
    for (auto& [key, attempt] : running_) {
        if (attempt->stop_reason == Attempt::StopReason::None) {
            attempt->stop_reason = Attempt::StopReason::Drain;
        }
        attempt->stop.request_stop();
    }
    work_.notify_all();
}

bool JobRegistry::wait_until_idle(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    return attempts_.wait_for(lock, timeout, [this] { return running_.empty(); });
}

void JobRegistry::surrender() {
    const auto attempts = [this] {
        const std::scoped_lock lock(mutex_);
        return running_;
    }();
    for (const auto& [key, attempt] : attempts) {
        end(*attempt, [this](const Claim& claim) { return store_.give_back(claim, clock_()); });
    }
}

bool JobRegistry::is_draining() const {
    const std::scoped_lock lock(mutex_);
    return is_draining_;
}

void JobRegistry::take_up() {
    for (const JobRecord& job : store_.unsettled()) {
        store_.lose({job.key, job.epoch}, lost_outcome(job), clock_());
        drop_previews(job.key, {});
    }
}

// Flushes events and ends what runs too long, while anything runs.
void JobRegistry::tend(std::stop_token stop) {
    while (!stop.stop_requested()) {
        std::vector<std::shared_ptr<Attempt>> attempts;
        {
            std::unique_lock lock(mutex_);
            if (!attempts_.wait(lock, stop, [&] { return !running_.empty(); })) {
                return;
            }
            attempts_.wait_for(lock, stop, options_.flush_interval, [] { return false; });
            const auto now = std::chrono::steady_clock::now();
            for (auto& [key, attempt] : running_) {
                if (now >= attempt->deadline && attempt->stop_reason == Attempt::StopReason::None) {
                    attempt->stop_reason = Attempt::StopReason::Timeout;
                    attempt->stop.request_stop();
                }
                attempts.push_back(attempt);
            }
        }
        for (const auto& attempt : attempts) {
            try {
                flush(*attempt, {}, {});
            } catch (const StoreError&) {
                // The events stay where they are, and the verdict will meet the same trouble.
            }
        }
        abandon_late_attempts();
    }
}

void JobRegistry::abandon_late_attempts() {
    std::vector<std::shared_ptr<Attempt>> abandoned;
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

void JobRegistry::flush(Attempt& attempt, const std::vector<NewEvent>& more,
                        const std::vector<ArtifactId>& previews) {
    {
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
            attempt.stop.request_stop();
        }
    }
    notify(attempt.job.key);
}

std::optional<JobRecord> JobRegistry::end(Attempt& attempt, const Verdict& verdict) {
    std::optional<JobRecord> job;
    try {
        flush(attempt, {}, {});
        job = verdict({attempt.job.key, attempt.job.epoch});
    } catch (const StoreError&) {
        const std::scoped_lock lock(mutex_);
        attempt.is_abandoned = true;
        throw;
    }
    {
        const std::scoped_lock lock(mutex_);
        const auto found = running_.find(attempt.job.key);
        if (found != running_.end() && found->second.get() == &attempt) {
            running_.erase(found);
            attempts_.notify_all();
        }
    }
    if (job && job->state == JobState::Queued) {
        wake_workers();
    }
    notify(attempt.job.key);
    return job;
}

std::optional<JobRecord> JobRegistry::lose(Attempt& attempt) {
    try {
        const auto job = end(attempt, [&](const Claim& claim) {
            return store_.lose(claim, lost_outcome(attempt.job), clock_());
        });
        drop_previews(attempt.job.key, {});
        return job;
    } catch (const StoreError&) {
        return std::nullopt;  // the tender tries again
    }
}

void JobRegistry::drop_previews(const JobKey& key, std::span<const std::string> keep) {
    artifacts_.remove_unneeded(key.tenant, store_.drop_previews(key, keep));
}

void JobRegistry::notify(const JobKey& key) const {
    if (listener_) {
        listener_(key);
    }
}

void JobRegistry::wake_workers() {
    const std::scoped_lock lock(mutex_);
    ++work_signals_;
    work_.notify_one();
}

JobView JobRegistry::view_of(JobRecord job) {
    JobView view{std::move(job), {}, 0};
    view.queue_position = store_.queue_position(view.job);
    if (view.job.state == JobState::Succeeded) {
        view.progress = {Stage::Write, 1.0, 1.0};
    }
    const std::scoped_lock lock(mutex_);
    const auto found = running_.find(view.job.key);
    if (found != running_.end() && found->second->job.epoch == view.job.epoch) {
        view.progress = found->second->progress;
    }
    return view;
}

std::string JobRegistry::lost_outcome(const JobRecord& job) const {
    return codec_.encode_failure({"WORKER_LOST",
                                  "Its worker was lost " + std::to_string(job.attempt) +
                                      " times, so the job isn't tried again.",
                                  false, Stage::Read});
}

}  // namespace remesh
