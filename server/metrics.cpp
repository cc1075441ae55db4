#include "server/metrics.h"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>
#include <sys/resource.h>

#include <algorithm>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "remesh/v1/job.pb.h"
#include "server/jobs/process_memory.h"
#include "server/tls.h"
#include "server/version.h"

namespace remesh {
namespace {

using Buckets = prometheus::Histogram::BucketBoundaries;

std::string label_of(JobState state) {
    return std::string(state_name(state));
}

/// From a part of a second to a day.
const Buckets& durations() {
    static const Buckets bounds{0.1, 0.3,   1.0,    3.0,    10.0,     30.0,
                                100, 300.0, 1000.0, 3000.0, 10'000.0, 86'400.0};
    return bounds;
}

double seconds_between(Time from, Time to) {
    return std::chrono::duration<double>(to - from).count();
}

std::string reason_of(const JobRecord& job) {
    v1::Failure failure;
    const bool has_failure = job.state == JobState::Failed || job.state == JobState::Quarantined;
    return has_failure && failure.ParseFromString(job.outcome) ? failure.reason() : "NONE";
}

double processor_seconds() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& time) {
        return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double open_files() {
    std::error_code error;
    double count = 0.0;
    for (std::filesystem::directory_iterator entry("/proc/self/fd", error), end;
         !error && entry != end; entry.increment(error)) {
        ++count;
    }
    return count;
}

}  // namespace

struct Metrics::Families {
    using Counters = prometheus::Family<prometheus::Counter>;
    using Gauges = prometheus::Family<prometheus::Gauge>;
    using Histograms = prometheus::Family<prometheus::Histogram>;

    Counters& counter(const std::string& name, const std::string& help) {
        return prometheus::BuildCounter().Name(name).Help(help).Register(registry);
    }
    Gauges& gauge(const std::string& name, const std::string& help) {
        return prometheus::BuildGauge().Name(name).Help(help).Register(registry);
    }
    Histograms& histogram(const std::string& name, const std::string& help) {
        return prometheus::BuildHistogram().Name(name).Help(help).Register(registry);
    }

    prometheus::Registry registry{};
    prometheus::Counter& created =
        counter("remesh_jobs_created_total", "Jobs that were accepted.").Add({});
    Counters& ended = counter("remesh_jobs_ended_total",
                              "Jobs that came to an end, by state and reason of failure.");
    prometheus::Counter& lost =
        counter("remesh_attempts_lost_total", "Attempts whose worker died or lost its lease.")
            .Add({});
    prometheus::Counter& given_back =
        counter("remesh_attempts_given_back_total", "Attempts given back by a server that stopped.")
            .Add({});
    prometheus::Histogram& wait =
        histogram("remesh_queue_wait_seconds", "From creation to the first attempt.")
            .Add({}, durations());
    Histograms& run = histogram("remesh_attempt_duration_seconds",
                                "From the start of a job's last attempt to its end, by state.");
    Histograms& stage = histogram("remesh_stage_duration_seconds", "Wall time of a stage.");
    Gauges& jobs = gauge("remesh_jobs", "Jobs on record, by state.");
    prometheus::Gauge& oldest =
        gauge("remesh_queue_oldest_seconds", "Age of the job that waits longest; 0 if none waits.")
            .Add({});
    prometheus::Gauge& ready =
        gauge("remesh_ready", "1 while new jobs are taken, 0 while shutting down.").Add({});
    prometheus::Gauge& disk_free =
        gauge("remesh_disk_free_bytes", "Free space where the data directory is.").Add({});
    prometheus::Gauge& disk_size =
        gauge("remesh_disk_size_bytes", "Size of the disk where the data directory is.").Add({});
    prometheus::Gauge& certificate =
        gauge("remesh_certificate_expiry_timestamp_seconds",
              "When the server's certificate ends, since 1970; +Inf without TLS.")
            .Add({});
    Counters& responses = counter("remesh_http_responses_total", "Answers over HTTP, by status.");
    prometheus::Counter& cpu =
        counter("process_cpu_seconds_total", "User and system time of this process.").Add({});
    prometheus::Gauge& memory =
        gauge("process_resident_memory_bytes", "Memory of this process.").Add({});
    prometheus::Gauge& files = gauge("process_open_fds", "Open files of this process.").Add({});
    prometheus::Gauge& started =
        gauge("process_start_time_seconds", "When this process started, since 1970.").Add({});
};

Metrics::Metrics(JobRegistry& registry, JobStore& store, const MetricsOptions& options)
    : registry_(registry),
      store_(store),
      options_(options),
      start_(system_now()),
      families_(std::make_unique<Families>()) {
    families_->gauge("remesh_build_info", "Always 1; the version is a label.")
        .Add({{"version", kVersion}})
        .Set(1.0);
    families_->started.Set(seconds_between(Time{}, start_));
    families_->certificate.Set(std::numeric_limits<double>::infinity());
    // A series that is there from the start at 0 has a rate when the first failure comes.
    for (std::size_t i = 0; i < kStateNames.size(); ++i) {
        const auto state = static_cast<JobState>(i);
        families_->jobs.Add({{"state", label_of(state)}});
        if (is_terminal(state) && state != JobState::Failed && state != JobState::Quarantined) {
            families_->ended.Add({{"state", label_of(state)}, {"reason", "NONE"}});
        }
    }
    for (const char* reason : {"INVALID_INPUT", "UNSUPPORTED", "UNMESHABLE", "TOO_LARGE",
                               "BOUND_NOT_MET", "TIMEOUT", "STORAGE", "INTERNAL"}) {
        families_->ended.Add({{"state", "failed"}, {"reason", reason}});
    }
    families_->ended.Add({{"state", "quarantined"}, {"reason", "WORKER_LOST"}});
    for (const int http_status : {200, 500}) {
        families_->responses.Add({{"code", std::to_string(http_status)}});
    }
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

Metrics::~Metrics() = default;

void Metrics::notify(const JobKey& key) {
    const std::scoped_lock lock(mutex_);
    pending_.insert(key);
    changed_.notify_all();
}

void Metrics::count_response(int http_status) {
    families_->responses.Add({{"code", std::to_string(http_status)}}).Increment();
}

void Metrics::settle() {
    registry_.settle();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return pending_.empty() && !is_reading_; });
}

std::string Metrics::text() {
    update_gauges();
    std::ostringstream out;
    prometheus::TextSerializer().Serialize(out, families_->registry.Collect());
    return out.str();
}

void Metrics::run(const std::stop_token& stop) {
    while (true) {
        std::set<JobKey> keys;
        {
            std::unique_lock lock(mutex_);
            if (!changed_.wait(lock, stop, [this] { return !pending_.empty(); })) {
                return;
            }
            keys = std::exchange(pending_, {});
            is_reading_ = true;
        }
        for (const JobKey& key : keys) {
            try {
                read(key);
            } catch (const std::exception&) {
                cursors_.erase(key);  // deleted meanwhile, or the store is in trouble
            }
        }
        std::unique_lock lock(mutex_);
        is_reading_ = false;
        changed_.notify_all();
        changed_.wait_for(lock, stop, options_.interval, [] { return false; });
    }
}

void Metrics::read(const JobKey& key) {
    constexpr std::size_t kBatch = 500;
    const JobView job = registry_.get(key);
    Cursor& cursor = cursors_[key];
    while (cursor.sequence < job.job.last_sequence) {
        const auto events = registry_.events_after(key, cursor.sequence, kBatch);
        if (events.empty()) {
            break;
        }
        for (const StoredEvent& event : events) {
            cursor.sequence = event.sequence;
            if (event.kind == EventKind::State) {
                count_state(job, event, cursor);
            } else if (event.kind == EventKind::Progress) {
                v1::JobEvent body;
                body.ParseFromString(event.payload);
                const auto stage = static_cast<Stage>(body.progress().stage() - 1);
                if (body.progress().stage() != v1::STAGE_UNSPECIFIED && cursor.stage != stage) {
                    leave_stage(event.time, cursor);
                    cursor.stage = stage;
                    cursor.stage_start = event.time;
                }
            }
        }
    }
    if (is_terminal(job.job.state) && cursor.sequence >= job.job.last_sequence) {
        cursors_.erase(key);
    }
}

void Metrics::count_state(const JobView& job, const StoredEvent& event, Cursor& cursor) {
    leave_stage(event.time, cursor);
    cursor.stage.reset();
    // What was before this process is in the counters of the one before it.
    const bool is_ours = event.time >= start_;
    if (event.state == JobState::Running) {
        cursor.start = event.time;
        if (is_ours && event.attempt == 1 && cursor.attempt == 0) {
            families_->wait.Observe(seconds_between(job.job.create_time, event.time));
        }
    } else if (event.state == JobState::Queued && is_ours) {
        (event.sequence == 1               ? families_->created
         : event.attempt >= cursor.attempt ? families_->lost
                                           : families_->given_back)
            .Increment();
    } else if (is_terminal(event.state) && is_ours) {
        if (event.sequence == 1) {
            families_->created.Increment();  // answered from an earlier result
        }
        if (event.state == JobState::Quarantined) {
            families_->lost.Increment();
        }
        families_->ended.Add({{"state", label_of(event.state)}, {"reason", reason_of(job.job)}})
            .Increment();
        if (cursor.start != Time{}) {
            families_->run.Add({{"state", label_of(event.state)}}, durations())
                .Observe(seconds_between(cursor.start, event.time));
        }
    }
    cursor.attempt = event.attempt;
}

void Metrics::leave_stage(Time time, Cursor& cursor) {
    if (cursor.stage && time >= start_) {
        families_->stage.Add({{"stage", std::string(stage_name(*cursor.stage))}}, durations())
            .Observe(seconds_between(cursor.stage_start, time));
    }
}

void Metrics::update_gauges() {
    const StoreFigures figures = store_.figures();
    for (std::size_t i = 0; i < kStateNames.size(); ++i) {
        const auto state = static_cast<JobState>(i);
        const auto found = figures.jobs.find(state);
        families_->jobs.Add({{"state", label_of(state)}})
            .Set(found == figures.jobs.end() ? 0.0 : static_cast<double>(found->second));
    }
    families_->oldest.Set(figures.oldest_queued
                              ? std::max(0.0, seconds_between(*figures.oldest_queued, system_now()))
                              : 0.0);
    families_->ready.Set(registry_.is_draining() ? 0.0 : 1.0);
    std::error_code error;
    const auto space = std::filesystem::space(options_.data_dir, error);
    if (!error) {
        families_->disk_free.Set(static_cast<double>(space.available));
        families_->disk_size.Set(static_cast<double>(space.capacity));
    }
    if (!options_.certificate.empty()) {
        try {
            families_->certificate.Set(static_cast<double>(
                certificate_end(options_.certificate).time_since_epoch().count()));
        } catch (const std::runtime_error&) {
            // Between two copies. The old one is still served, and told.
        }
    }
    const double more = processor_seconds() - families_->cpu.Value();
    if (more > 0.0) {
        families_->cpu.Increment(more);
    }
    families_->memory.Set(static_cast<double>(resident_bytes()));
    families_->files.Set(open_files());
}

}  // namespace remesh
