#include "server/watch_stream.h"

#include <array>
#include <deque>
#include <optional>
#include <utility>

#include "server/convert.h"
#include "server/open_stream.h"

namespace remesh {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

// Events taken from the store at a time.
constexpr std::size_t kBatch = 64;

bool can_be_skipped(EventKind kind) {
    return kind == EventKind::Progress || kind == EventKind::Sample || kind == EventKind::Preview;
}

}  // namespace

void check_credential(const IsStillValid& is_still_valid, const Principal& who,
                      std::chrono::milliseconds interval,
                      std::chrono::steady_clock::time_point& last_check) {
    const auto now = std::chrono::steady_clock::now();
    if (is_still_valid && now - last_check >= interval) {
        last_check = now;
        if (!is_still_valid(who)) {
            throw StatusError(credential_ended_status());
        }
    }
}

/// One call. gRPC's callbacks only set flags under the hub's mutex; all else is the hub's thread's.
class WatchStream final : public grpc::ServerWriteReactor<grpc::ByteBuffer> {
public:
    explicit WatchStream(WatchHub& hub) : hub_(hub) {}

    void OnWriteDone(bool ok) override {
        {
            const std::scoped_lock lock(hub_.mutex_);
            is_writing_ = false;
            is_gone_ = is_gone_ || !ok;
        }
        hub_.wake(this);
    }
    void OnCancel() override {
        {
            const std::scoped_lock lock(hub_.mutex_);
            is_gone_ = true;
        }
        hub_.wake(this);
    }
    void OnDone() override { delete this; }

private:
    friend class WatchHub;

    /// The next message that the reader should get, or nothing.
    std::optional<WatchMessage> next(WatchNews& news, JobRegistry& registry,
                                     std::int64_t max_backlog);
    void take_batch(JobRegistry& registry, std::int64_t last_sequence, std::int64_t max_backlog);

    WatchHub& hub_;

    JobKey key_{};             // needs hub_.mutex_ until the stream has started
    bool is_writing_ = false;  // needs hub_.mutex_
    bool is_gone_ = false;     // needs hub_.mutex_

    // the hub's thread only, once the stream has started
    Principal who_{};
    std::shared_ptr<void> slot_;
    bool is_open_ = false;      // the snapshot that opens the stream was sent
    bool is_complete_ = false;  // the last message was sent
    std::int64_t after_ = 0;    // last sequence that was sent or skipped
    std::int64_t history_ = 0;  // sequences up to this one are sent in full
    std::int64_t skipped_ = 0;  // since the last message
    std::deque<StoredEvent> batch_;
    WatchMessage message_;
    SteadyTime last_write_ = std::chrono::steady_clock::now();
    SteadyTime last_check_ = last_write_;  // whether the caller may still watch
};

std::optional<WatchMessage> WatchStream::next(WatchNews& news, JobRegistry& registry,
                                              std::int64_t max_backlog) {
    if (!is_open_) {
        is_open_ = true;
        return news.snapshot(key_);
    }
    const JobRecord& job = news.view(key_).job;
    const JobState state = job.state;
    const std::int64_t last_sequence = job.last_sequence;
    if (batch_.empty() && after_ < last_sequence) {
        take_batch(registry, last_sequence, max_backlog);
    }
    if (!batch_.empty()) {
        const StoredEvent event = std::move(batch_.front());
        batch_.pop_front();
        after_ = event.sequence;
        is_complete_ = event.kind == EventKind::State && is_terminal(event.state);
        return news.message(key_, event, std::exchange(skipped_, 0));
    }
    if (is_terminal(state)) {
        // The reader had seen the end already; it is told once more.
        const auto last = registry.events_after(key_, last_sequence - 1, 1);
        is_complete_ = true;
        return last.empty() ? std::nullopt : std::optional(news.message(key_, last.front(), 0));
    }
    return std::nullopt;
}

void WatchStream::take_batch(JobRegistry& registry, std::int64_t last_sequence,
                             std::int64_t max_backlog) {
    const bool is_behind = after_ >= history_ && last_sequence - after_ > max_backlog;
    std::int64_t cursor = after_;
    if (!is_behind) {
        const auto events = registry.events_after(key_, cursor, kBatch);
        batch_.assign(events.begin(), events.end());
        return;
    }
    // Everything up to now in one go: what can't be skipped, and the newest of what can.
    std::array<std::int64_t, 5> newest{};
    std::deque<StoredEvent> kept;
    while (cursor < last_sequence) {
        const auto events = registry.events_after(key_, cursor, kBatch);
        if (events.empty()) {
            break;
        }
        cursor = events.back().sequence;
        for (const StoredEvent& event : events) {
            newest[static_cast<std::size_t>(event.kind)] = event.sequence;
            kept.push_back(event);
        }
        skipped_ += static_cast<std::int64_t>(std::erase_if(kept, [&](const StoredEvent& event) {
            return can_be_skipped(event.kind) &&
                   event.sequence != newest[static_cast<std::size_t>(event.kind)];
        }));
    }
    batch_ = std::move(kept);
}

WatchHub::WatchHub(JobRegistry& registry, const WatchOptions& options, IsStillValid is_still_valid)
    : registry_(registry),
      options_(options),
      is_still_valid_(std::move(is_still_valid)),
      slots_("watches", options.max_watches, options.max_watches_of_tenant),
      bytes_("bytes of watches", options.max_bytes, options.max_bytes_of_tenant),
      news_(registry, bytes_) {
    thread_ = std::jthread([this](std::stop_token stop) { run(std::move(stop)); });
}

WatchHub::~WatchHub() = default;

grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchHub::open(Executor& executor,
                                                           Admission admission) {
    return open_stream<WatchTarget>(
        executor, new WatchStream(*this), std::move(admission),
        [this](WatchStream& stream, const WatchTarget& target) { return start(stream, target); });
}

grpc::Status WatchHub::start(WatchStream& stream, const WatchTarget& target) {
    const JobView view = registry_.get(target.key);
    {
        const std::scoped_lock lock(mutex_);
        if (is_closed_) {
            return shutting_down_status();
        }
        stream.slot_ = slots_.take(target.who.tenant);
        stream.key_ = target.key;
        stream.who_ = target.who;
        stream.after_ = target.after;
        stream.history_ = view.job.last_sequence;
        streams_[target.key].insert(&stream);
    }
    wake(&stream);
    return grpc::Status::OK;
}

void WatchHub::notify(const JobKey& key) {
    const std::scoped_lock lock(mutex_);
    if (const auto found = streams_.find(key); found != streams_.end()) {
        awake_.insert(found->second.begin(), found->second.end());
        changed_jobs_.insert(key);
        changed_.notify_one();
    }
}

void WatchHub::close() {
    const std::scoped_lock lock(mutex_);
    is_closed_ = true;
    for (const auto& [key, streams] : streams_) {
        awake_.insert(streams.begin(), streams.end());
    }
    changed_.notify_one();
}

// A stream that was finished meanwhile isn't in streams_ any more: its last callbacks wake nobody.
void WatchHub::wake(WatchStream* stream) {
    const std::scoped_lock lock(mutex_);
    const auto found = streams_.find(stream->key_);
    if (found != streams_.end() && found->second.contains(stream)) {
        awake_.insert(stream);
        changed_.notify_one();
    }
}

void WatchHub::run(std::stop_token stop) {
    while (!stop.stop_requested()) {
        std::set<WatchStream*> awake;
        std::set<JobKey> changed_jobs;
        {
            std::unique_lock lock(mutex_);
            const bool is_due = changed_.wait_for(lock, stop, options_.heartbeat / 4,
                                                  [this] { return !awake_.empty(); });
            if (!is_due) {
                for (const auto& [key, streams] : streams_) {
                    awake_.insert(streams.begin(), streams.end());
                }
            }
            awake = std::exchange(awake_, {});
            changed_jobs = std::exchange(changed_jobs_, {});
        }
        for (const JobKey& key : changed_jobs) {
            news_.expire(key);
        }
        for (WatchStream* stream : awake) {
            feed(*stream);
        }
    }
}

// The hub's thread alone finishes streams, so one that is still in streams_ is alive.
void WatchHub::feed(WatchStream& stream) {
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
    stream.message_ = {};  // It was sent.
    std::optional<WatchMessage> message;
    if (!end && !stream.is_complete_) {
        try {
            message = stream.next(news_, registry_, options_.max_backlog);
            check_credential(is_still_valid_, stream.who_, options_.heartbeat, stream.last_check_);
        } catch (const std::exception&) {
            end = to_status(std::current_exception());
        }
    }
    if (!end && !message && stream.is_complete_) {
        end = grpc::Status::OK;
    }
    if (!end && !message &&
        std::chrono::steady_clock::now() - stream.last_write_ >= options_.heartbeat) {
        v1::JobEvent heartbeat;
        heartbeat.mutable_heartbeat();
        message = written(heartbeat);
    }
    if (end) {
        finish(stream, *end);
    } else if (message) {
        write(stream, std::move(*message));
    }
}

void WatchHub::finish(WatchStream& stream, const grpc::Status& status) {
    bool is_last = false;
    {
        const std::scoped_lock lock(mutex_);
        const auto found = streams_.find(stream.key_);
        found->second.erase(&stream);
        is_last = found->second.empty();
        if (is_last) {
            streams_.erase(found);
            changed_jobs_.erase(stream.key_);
        }
        awake_.erase(&stream);
    }
    if (is_last) {
        news_.forget(stream.key_);
    }
    stream.slot_.reset();
    stream.Finish(status);
}

void WatchHub::write(WatchStream& stream, WatchMessage message) {
    {
        const std::scoped_lock lock(mutex_);
        stream.is_writing_ = true;
    }
    stream.last_write_ = std::chrono::steady_clock::now();
    stream.message_ = std::move(message);
    stream.StartWrite(&stream.message_.bytes);
}

}  // namespace remesh
