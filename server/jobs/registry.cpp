#include "server/jobs/registry.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/jobs/job_inputs.h"

namespace remesh {
namespace {

// Listeners hear of changes at once; this long if the way of hearing fails.
constexpr std::chrono::milliseconds kListenInterval{500};
// Newest successes that an estimate goes by.
constexpr std::size_t kRunsForEstimate = 20;

JobError limit_error(const std::string& subject, const std::string& what, std::int64_t limit) {
    return {JobErrorCode::LimitPassed, what + std::to_string(limit), subject};
}

}  // namespace

JobRegistry::JobRegistry(JobStore& store, ArtifactStore& artifacts, const JobCodec& codec,
                         const Engine& engine, const RegistryOptions& options, Clock clock)
    : store_(store),
      artifacts_(artifacts),
      codec_(codec),
      engine_(engine),
      options_(options),
      clock_(clock ? std::move(clock) : system_now) {}

JobRegistry::~JobRegistry() = default;

void JobRegistry::set_listener(Listener listener) {
    listener_ = std::move(listener);
    // Followed from now on, not from when the thread gets to it.
    thread_ = std::jthread(
        [this, feed = store_.follow()](const std::stop_token& stop) { listen(*feed, stop); });
}

JobView JobRegistry::submit(const Submission& submission) {
    if (is_draining()) {
        throw JobError(JobErrorCode::ShuttingDown, "the server is shutting down");
    }
    const JobRequest request = codec_.decode_spec(submission.spec);
    if (auto problems = engine_.check(request); !problems.empty()) {
        throw JobError(std::move(problems));
    }
    if (submission.validate_only) {
        return check_only(submission, request);
    }
    NewJob job{{submission.tenant, random_hex(10)},
               submission.request_id,
               submission.spec,
               request.priority,
               options_.max_attempts,
               request.inputs(),
               codec_.cache_key(submission.spec),
               false,
               {}};
    job.may_reuse = !request.skip_cache && is_result_whole(submission.tenant, job.cache_key);
    return create(job);
}

bool JobRegistry::is_result_whole(const std::string& tenant, const std::string& cache_key) const {
    const auto outputs = store_.reusable_outputs(tenant, cache_key);
    return std::all_of(outputs.begin(), outputs.end(), [&](const std::string& output) {
        return artifacts_.find_whole(tenant, output).has_value();
    });
}

JobView JobRegistry::check_only(const Submission& submission, const JobRequest& request) {
    const JobInputs inputs(artifacts_, submission.tenant, request);
    if (!inputs.missing().empty()) {
        throw JobError(JobErrorCode::MissingInput, "the input artifact isn't there",
                       inputs.missing());
    }
    JobView view;
    view.job.spec = submission.spec;
    view.job.priority = request.priority;
    view.job.max_attempts = options_.max_attempts;
    view.estimate = options_.estimator ? options_.estimator(submission.spec, inputs.files())
                                       : engine_.estimate(request, inputs.files());
    return view;
}

JobView JobRegistry::retry(const JobKey& key, const std::string& request_id) {
    if (is_draining()) {
        throw JobError(JobErrorCode::ShuttingDown, "the server is shutting down");
    }
    const JobView old = get(key);
    if (!is_terminal(old.job.state) || old.job.state == JobState::Succeeded) {
        throw JobError(JobErrorCode::NotRetryable,
                       "only a failed, cancelled or quarantined job can be tried again", key.id);
    }
    const JobRequest request = codec_.decode_spec(old.job.spec);
    return create({{key.tenant, random_hex(10)},
                   request_id,
                   old.job.spec,
                   request.priority,
                   options_.max_attempts,
                   request.inputs(),
                   codec_.cache_key(old.job.spec),
                   false,
                   key.id});
}

JobView JobRegistry::create(const NewJob& job) {
    const auto damaged = std::find_if(
        job.inputs.begin(), job.inputs.end(),
        [&](const std::string& input) { return !artifacts_.find_whole(job.key.tenant, input); });
    const bool is_whole = damaged == job.inputs.end();
    QueueLimits limits = options_.limits;
    if (!is_whole) {
        limits.max_queued = 0;  // Nothing new, but a repeated request still gets its job.
    }
    auto creation = store_.create(job, limits, clock_());
    if (!is_whole && creation.verdict == Creation::Verdict::QueueFull) {
        throw JobError(JobErrorCode::MissingInput, "the input artifact isn't there", *damaged);
    }
    switch (creation.verdict) {
        case Creation::Verdict::Created:
        case Creation::Verdict::Repeated: break;
        case Creation::Verdict::Conflict:
            throw JobError(JobErrorCode::RequestIdReused,
                           "request_id was used before with another spec", job.request_id);
        case Creation::Verdict::QueueFull:
            throw limit_error("queue", "the queue is full: jobs that may wait: ", creation.limit);
        case Creation::Verdict::TenantQueueFull:
            throw limit_error("tenants/" + job.key.tenant + "/queue",
                              "the tenant's queue is full: jobs that may wait: ", creation.limit);
        case Creation::Verdict::TenantBytesFull:
            throw limit_error(
                "tenants/" + job.key.tenant + "/bytes",
                "the tenant's storage is full, delete jobs; bytes it may keep: ", creation.limit);
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
    if (is_terminal(job->state)) {
        artifacts_.checkpoints().remove(key);
    }
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
    artifacts_.checkpoints().remove(key);
    notify(key);  // the store tells of events, and this job has none any more
}

void JobRegistry::settle() {
    const std::int64_t mine = ++asked_;
    for (std::int64_t heard = heard_; heard < mine; heard = heard_) {
        heard_.wait(heard);
    }
}

void JobRegistry::listen(ChangeFeed& feed, const std::stop_token& stop) {
    while (!stop.stop_requested()) {
        const std::int64_t asked = asked_;
        try {
            for (const JobKey& key : feed.next(kListenInterval, stop)) {
                notify(key);
            }
            heard_ = asked;
            heard_.notify_all();
        } catch (const StoreError& error) {
            spdlog::error("event=store_failed message=\"{}\"", error.what());
            std::this_thread::sleep_for(kListenInterval);
        }
    }
}

void JobRegistry::notify(const JobKey& key) const {
    if (listener_) {
        listener_(key);
    }
}

JobView JobRegistry::view_of(JobRecord job) {
    JobView view{std::move(job), {}, 0, {}, {}};
    switch (view.job.state) {
        case JobState::Queued: {
            view.queue_position = store_.queue_position(view.job);
            const auto mean = store_.mean_run_time(view.job.key.tenant, kRunsForEstimate);
            if (mean) {
                // Jobs ahead in rounds of all workers; whoever is first may start any moment.
                const Time start = clock_() + *mean * (view.queue_position / options_.workers);
                view.estimated_start = std::max(start, view.job.retry_time.value_or(start));
            }
            break;
        }
        case JobState::Running:
        case JobState::Cancelling:
            if (const auto event = store_.last_progress(view.job.key); !event.empty()) {
                view.progress = codec_.decode_progress(event);
            }
            break;
        case JobState::Succeeded: view.progress = {Stage::Write, 1.0, 1.0}; break;
        case JobState::Failed:
        case JobState::Cancelled:
        case JobState::Quarantined: break;
    }
    return view;
}

}  // namespace remesh
