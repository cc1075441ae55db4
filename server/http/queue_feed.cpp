#include "server/http/queue_feed.h"

#include <chrono>
#include <set>
#include <utility>
#include <vector>

#include "server/http/respond.h"

namespace remesh::http {
namespace {

constexpr std::chrono::seconds kInterval{1};
constexpr int kPageSize = 100;

using Jobs = google::protobuf::RepeatedPtrField<v1::Job>;

/// Appends those of `more` that aren't there.
void add_missing(Jobs& jobs, Jobs& more) {
    std::set<std::string> known;
    for (const v1::Job& job : jobs) {
        known.insert(job.name());
    }
    for (v1::Job& job : more) {
        if (!known.contains(job.name())) {
            jobs.Add(std::move(job));
        }
    }
}

}  // namespace

QueueFeed::QueueFeed(v1::JobService::Stub& jobs, v1::QueueService::Stub& queue, OpenCalls& calls)
    : jobs_(jobs), queue_(queue), calls_(calls) {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

QueueFeed::~QueueFeed() {
    close();
}

QueueFeed::Subscription::Subscription(QueueFeed& feed, std::string token)
    : feed_(feed), token_(std::move(token)) {
    const std::scoped_lock lock(feed_.mutex_);
    ++feed_.channels_[token_].watchers;
    ++feed_.arrivals_;
    feed_.changed_.notify_all();
}

QueueFeed::Subscription::~Subscription() {
    const std::scoped_lock lock(feed_.mutex_);
    const auto channel = feed_.channels_.find(token_);
    if (--channel->second.watchers == 0) {
        feed_.channels_.erase(channel);
    }
}

std::optional<QueueFeed::Page> QueueFeed::Subscription::next(std::uint64_t version,
                                                             std::chrono::milliseconds timeout) {
    std::unique_lock lock(feed_.mutex_);
    const Page& page = feed_.channels_.at(token_).page;
    feed_.changed_.wait_for(lock, timeout,
                            [&] { return feed_.is_closed_ || page.version > version; });
    return page.version > version && !feed_.is_closed_ ? std::optional(page) : std::nullopt;
}

void QueueFeed::close() {
    const std::scoped_lock lock(mutex_);
    is_closed_ = true;
    changed_.notify_all();
}

bool QueueFeed::is_closed() const {
    const std::scoped_lock lock(mutex_);
    return is_closed_;
}

void QueueFeed::run(const std::stop_token& stop) {
    std::uint64_t seen = 0;
    while (!stop.stop_requested()) {
        std::vector<std::string> tokens;
        {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, stop, [this] { return is_closed_ || !channels_.empty(); });
            if (is_closed_ || stop.stop_requested()) {
                return;
            }
            seen = arrivals_;
            for (const auto& [token, channel] : channels_) {
                tokens.push_back(token);
            }
        }
        for (const std::string& token : tokens) {
            Page page = fetch(token);
            const std::scoped_lock lock(mutex_);
            const auto found = channels_.find(token);
            if (found == channels_.end()) {
                continue;
            }
            Page& old = found->second.page;
            if (old.version == 0 || old.json != page.json || old.summary != page.summary ||
                old.status.error_code() != page.status.error_code()) {
                page.version = old.version + 1;
                old = std::move(page);
                changed_.notify_all();
            }
        }
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, stop, kInterval, [&] { return is_closed_ || arrivals_ != seen; });
    }
}

QueueFeed::Page QueueFeed::fetch(const std::string& token) {
    v1::ListJobsResponse newest;
    v1::SummarizeQueueResponse summary;
    Page page;
    try {
        page.status = list(token, {}, &newest);
        // In a long queue those that run are older than all that are listed.
        if (page.status.ok() && !newest.next_page_token().empty()) {
            v1::ListJobsResponse running;
            page.status =
                list(token, {v1::Job::STATE_RUNNING, v1::Job::STATE_CANCELLING}, &running);
            add_missing(*newest.mutable_jobs(), *running.mutable_jobs());
        }
        if (page.status.ok()) {
            Call call(calls_, token);
            page.status = queue_.SummarizeQueue(call.context(), {}, &summary);
        }
    } catch (const ShuttingDown& closed) {
        page.status = grpc::Status(grpc::StatusCode::UNAVAILABLE, closed.what());
    }
    page.json = page.status.ok() ? to_json(newest) : to_json(page.status);
    page.summary = to_json(summary);
    return page;
}

grpc::Status QueueFeed::list(const std::string& token, std::initializer_list<v1::Job::State> states,
                             v1::ListJobsResponse* reply) {
    v1::ListJobsRequest request;
    request.set_page_size(kPageSize);
    for (const v1::Job::State state : states) {
        request.add_states(state);
    }
    Call call(calls_, token);
    const grpc::Status status = jobs_.ListJobs(call.context(), request, reply);
    for (v1::Job& job : *reply->mutable_jobs()) {
        shorten(job);
    }
    return status;
}

void shorten(v1::Job& job) {
    job.mutable_spec()->clear_options();
    if (job.has_result()) {
        job.mutable_result()->clear_provenance();
        auto* quality = job.mutable_result()->mutable_quality();
        for (v1::SurfaceQuality* surface : {quality->mutable_before(), quality->mutable_after()}) {
            surface->clear_min_angle();
            surface->clear_edge_length();
            surface->mutable_radius_ratio()->clear_histogram();
        }
        quality->clear_defects();
        if (quality->has_tets()) {
            quality->mutable_tets()->mutable_radius_ratio()->clear_histogram();
            quality->mutable_tets()->mutable_dihedral()->clear_histogram();
        }
    }
}

}  // namespace remesh::http
