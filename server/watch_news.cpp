#include "server/watch_news.h"

#include <array>
#include <utility>

#include "server/convert.h"

namespace remesh {
namespace {

// What is kept of all jobs; of those that weren't asked for of late it is made anew.
constexpr std::int64_t kMaxBytes = std::int64_t{64} << 20;

std::int64_t size_of(const JobView& view) {
    return static_cast<std::int64_t>(view.job.spec.size() + view.job.outcome.size());
}

grpc::Slice slice_of(const v1::JobEvent& event) {
    grpc::Slice slice(event.ByteSizeLong());
    event.SerializeWithCachedSizesToArray(const_cast<std::uint8_t*>(slice.begin()));
    return slice;
}

/// What an event has besides what happened.
v1::JobEvent frame_of(const StoredEvent& event, std::int64_t skipped) {
    v1::JobEvent frame;
    frame.set_sequence(event.sequence);
    *frame.mutable_time() = to_proto(event.time);
    frame.set_skipped_events(skipped);
    return frame;
}

/// A message in two parts is their merger, as protobuf reads it.
grpc::ByteBuffer merged(const grpc::Slice& first, const v1::JobEvent& second) {
    const std::array<grpc::Slice, 2> parts{first, slice_of(second)};
    return {parts.data(), parts.size()};
}

}  // namespace

WatchMessage written(const v1::JobEvent& event) {
    const grpc::Slice slice = slice_of(event);
    return {grpc::ByteBuffer(&slice, 1), {}};
}

const JobView& WatchNews::view(const JobKey& key) {
    return up_to_date(key).view;
}

WatchMessage WatchNews::snapshot(const JobKey& key) {
    News& news = up_to_date(key);
    if (!news.snapshot) {
        const JobRecord& job = news.view.job;
        v1::JobEvent event;
        *event.mutable_snapshot() = to_proto(news.view);
        *event.mutable_time() =
            to_proto(job.end_time.value_or(job.start_time.value_or(job.create_time)));
        news.snapshot = share(key, news, event);
    }
    return {grpc::ByteBuffer(&news.snapshot->bytes, 1), news.snapshot->room};
}

WatchMessage WatchNews::message(const JobKey& key, const StoredEvent& event, std::int64_t skipped) {
    if (event.kind != EventKind::State) {
        return {merged(grpc::Slice(event.payload), frame_of(event, skipped)), {}};
    }
    News* news = &up_to_date(key);
    if (event.sequence > news->view.job.last_sequence) {
        news = &read(key);  // What ended meanwhile has a result by now.
    }
    auto found = news->changes.find(event.sequence);
    if (found == news->changes.end()) {
        found =
            news->changes.emplace(event.sequence, share(key, *news, to_proto(event, news->view)))
                .first;
    }
    return {merged(found->second.bytes, frame_of(event, skipped)), found->second.room};
}

void WatchNews::expire(const JobKey& key) {
    if (const auto found = jobs_.find(key); found != jobs_.end()) {
        found->second.is_old = true;
    }
}

void WatchNews::forget(const JobKey& key) {
    if (const auto found = jobs_.find(key); found != jobs_.end()) {
        drop(found);
    }
}

WatchNews::News& WatchNews::up_to_date(const JobKey& key) {
    const auto found = jobs_.find(key);
    if (found == jobs_.end() || found->second.is_old ||
        std::chrono::steady_clock::now() - found->second.read_time > max_age_) {
        return read(key);
    }
    found->second.last_use = ++uses_;
    return found->second;
}

WatchNews::News& WatchNews::read(const JobKey& key) {
    News& news = jobs_[key];
    resize(news, -size_of(news.view) - (news.snapshot ? news.snapshot->size() : 0));
    news.snapshot.reset();
    news.view = {};
    try {
        news.view = registry_.get(key);
    } catch (...) {
        forget(key);
        throw;
    }
    news.read_time = std::chrono::steady_clock::now();
    news.is_old = false;
    news.last_use = ++uses_;
    resize(news, size_of(news.view));
    return news;
}

WatchNews::Shared WatchNews::share(const JobKey& key, News& news, const v1::JobEvent& event) {
    Shared shared{{}, bytes_.take(key.tenant, static_cast<std::int64_t>(event.ByteSizeLong()))};
    shared.bytes = slice_of(event);
    resize(news, shared.size());
    return shared;
}

void WatchNews::drop(std::map<JobKey, News>::iterator job) {
    size_ -= job->second.size;
    jobs_.erase(job);
}

void WatchNews::resize(News& news, std::int64_t change) {
    news.size += change;
    size_ += change;
    while (size_ > kMaxBytes && jobs_.size() > 1) {
        auto oldest = jobs_.end();
        for (auto job = jobs_.begin(); job != jobs_.end(); ++job) {
            if (&job->second != &news &&
                (oldest == jobs_.end() || job->second.last_use < oldest->second.last_use)) {
                oldest = job;
            }
        }
        drop(oldest);
    }
}

}  // namespace remesh
