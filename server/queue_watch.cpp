#include "server/queue_watch.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "server/convert.h"
#include "server/open_stream.h"

namespace remesh {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

// Jobs at the start of a stream, and names of changed ones that it remembers.
constexpr std::size_t kMaxJobs = 1'000;
// Least time between two messages about one job.
constexpr std::chrono::milliseconds kRound{500};

v1::Job in_short(const JobView& view) {
    v1::Job job = to_proto(view);
    job.mutable_spec()->clear_options();
    job.clear_result();
    return job;
}

}  // namespace

/// One call. gRPC's callbacks only set flags under the hub's mutex; all else is the hub's thread's.
class QueueStream final : public grpc::ServerWriteReactor<v1::QueueEvent> {
public:
    explicit QueueStream(QueueHub& hub) : hub_(hub) {}

    void OnWriteDone(bool ok) override {
        {
            const std::scoped_lock lock(hub_.mutex_);
            is_writing_ = false;
            is_gone_ = is_gone_ || !ok;
        }
        hub_.wake();
    }
    void OnCancel() override {
        {
            const std::scoped_lock lock(hub_.mutex_);
            is_gone_ = true;
        }
        hub_.wake();
    }
    void OnDone() override { delete this; }

private:
    friend class QueueHub;

    QueueHub& hub_;

    bool is_writing_ = false;      // needs hub_.mutex_
    bool is_gone_ = false;         // needs hub_.mutex_
    bool has_overflowed_ = false;  // needs hub_.mutex_
    std::set<JobKey> changed_;     // needs hub_.mutex_

    // the hub's thread only, once the stream has started
    Principal who_{};
    std::shared_ptr<void> slot_;
    bool is_open_ = false;  // `opened` was sent
    // Until then jobs are taken from the store one at a time: a spec may have 1.5 MiB.
    std::size_t listed_ = 0;
    std::optional<std::int64_t> last_listed_{};
    std::vector<JobKey> round_{};  // of this round, not yet sent
    v1::QueueEvent message_;
    SteadyTime last_write_ = std::chrono::steady_clock::now();
    SteadyTime last_round_ = last_write_;
    SteadyTime last_check_ = last_write_;
};

QueueHub::QueueHub(JobRegistry& registry, const WatchOptions& options, IsStillValid is_still_valid)
    : registry_(registry),
      options_(options),
      is_still_valid_(std::move(is_still_valid)),
      slots_("queue watches", options.max_watches, options.max_watches_of_tenant) {
    thread_ = std::jthread([this](std::stop_token stop) { run(std::move(stop)); });
}

QueueHub::~QueueHub() = default;

grpc::ServerWriteReactor<v1::QueueEvent>* QueueHub::open(Executor& executor, Admission admission) {
    return open_stream<Principal>(
        executor, new QueueStream(*this), std::move(admission),
        [this](QueueStream& stream, const Principal& who) { return start(stream, who); });
}

grpc::Status QueueHub::start(QueueStream& stream, const Principal& who) {
    const std::scoped_lock lock(mutex_);
    if (is_closed_) {
        return shutting_down_status();
    }
    stream.slot_ = slots_.take(who.tenant);
    stream.who_ = who;
    streams_.insert(&stream);
    is_awake_ = true;
    changed_.notify_one();
    return grpc::Status::OK;
}

void QueueHub::notify(const JobKey& key) {
    const std::scoped_lock lock(mutex_);
    for (QueueStream* stream : streams_) {
        if (stream->who_.tenant != key.tenant || stream->has_overflowed_) {
            continue;
        }
        changed_jobs_.insert(key);
        stream->changed_.insert(key);
        if (stream->changed_.size() > kMaxJobs) {
            stream->changed_.clear();
            stream->has_overflowed_ = true;
        }
        is_awake_ = true;
    }
    changed_.notify_one();
}

void QueueHub::close() {
    const std::scoped_lock lock(mutex_);
    is_closed_ = true;
    is_awake_ = true;
    changed_.notify_one();
}

void QueueHub::wake() {
    const std::scoped_lock lock(mutex_);
    is_awake_ = true;
    changed_.notify_one();
}

void QueueHub::run(std::stop_token stop) {
    while (!stop.stop_requested()) {
        std::vector<QueueStream*> streams;
        {
            std::unique_lock lock(mutex_);
            const auto tick = streams_.empty() ? std::chrono::milliseconds(options_.heartbeat)
                                               : std::min<std::chrono::milliseconds>(
                                                     kRound / 2, options_.heartbeat / 4);
            changed_.wait_for(lock, stop, tick, [this] { return is_awake_; });
            is_awake_ = false;
            forget_changed();
            streams.assign(streams_.begin(), streams_.end());
        }
        for (QueueStream* stream : streams) {
            feed(*stream);
        }
    }
}

const v1::Job& QueueHub::short_of(const JobKey& key) {
    const auto now = std::chrono::steady_clock::now();
    const auto found = told_.find(key);
    // A queued job's place changes without any event of its own.
    if (found != told_.end() && now - found->second.time < kRound) {
        return found->second.job;
    }
    Told told{in_short(registry_.get(key)), now};
    if (told_.size() >= kMaxJobs) {
        told_.clear();
    }
    return told_.insert_or_assign(key, std::move(told)).first->second.job;
}

void QueueHub::forget_changed() {
    for (const JobKey& key : std::exchange(changed_jobs_, {})) {
        told_.erase(key);
    }
}

v1::QueueEvent QueueHub::next_at_first(QueueStream& stream) {
    v1::QueueEvent event;
    std::vector<JobView> jobs;
    if (stream.listed_ < kMaxJobs) {
        jobs =
            registry_.list({.tenant = stream.who_.tenant,
                            .states = {JobState::Queued, JobState::Running, JobState::Cancelling},
                            .before = stream.last_listed_,
                            .limit = 1});
    }
    if (jobs.empty()) {
        stream.is_open_ = true;
        event.mutable_opened();
    } else {
        ++stream.listed_;
        stream.last_listed_ = jobs.front().job.number;
        *event.mutable_job() = in_short(jobs.front());
    }
    return event;
}

std::optional<v1::QueueEvent> QueueHub::next(QueueStream& stream) {
    const auto now = std::chrono::steady_clock::now();
    if (!stream.is_open_) {
        return next_at_first(stream);
    }
    v1::QueueEvent event;
    if (stream.round_.empty() && now - stream.last_round_ >= kRound) {
        const std::scoped_lock lock(mutex_);
        if (std::exchange(stream.has_overflowed_, false)) {
            event.mutable_resync();
            return event;
        }
        if (!stream.changed_.empty()) {
            forget_changed();
            stream.last_round_ = now;
            stream.round_.assign(stream.changed_.begin(), stream.changed_.end());
            stream.changed_.clear();
        }
    }
    if (!stream.round_.empty()) {
        const JobKey key = std::move(stream.round_.back());
        stream.round_.pop_back();
        try {
            *event.mutable_job() = short_of(key);
        } catch (const JobError&) {
            event.set_deleted(job_name(key));
        }
        return event;
    }
    if (now - stream.last_write_ >= options_.heartbeat) {
        event.mutable_heartbeat();
        return event;
    }
    return std::nullopt;
}

// The hub's thread alone finishes streams, so one that is still in streams_ is alive.
void QueueHub::feed(QueueStream& stream) {
    std::optional<grpc::Status> end;
    {
        const std::scoped_lock lock(mutex_);
        if (stream.is_writing_) {
            return;
        }
        if (stream.is_gone_) {
            end = grpc::Status(grpc::StatusCode::CANCELLED, "the client left");
        } else if (is_closed_) {
            end = shutting_down_status();
        }
    }
    std::optional<v1::QueueEvent> event;
    if (!end) {
        try {
            check_credential(is_still_valid_, stream.who_, options_.heartbeat, stream.last_check_);
            event = next(stream);
        } catch (const std::exception&) {
            end = to_status(std::current_exception());
        }
    }
    if (end) {
        finish(stream, *end);
    } else if (event) {
        write(stream, std::move(*event));
    }
}

void QueueHub::finish(QueueStream& stream, const grpc::Status& status) {
    {
        const std::scoped_lock lock(mutex_);
        streams_.erase(&stream);
    }
    stream.slot_.reset();
    stream.Finish(status);
}

void QueueHub::write(QueueStream& stream, v1::QueueEvent event) {
    *event.mutable_time() = to_proto(system_now());
    stream.message_ = std::move(event);
    stream.last_write_ = std::chrono::steady_clock::now();
    {
        const std::scoped_lock lock(mutex_);
        stream.is_writing_ = true;
    }
    stream.StartWrite(&stream.message_);
}

}  // namespace remesh
