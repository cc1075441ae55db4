#pragma once

#include <condition_variable>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "remesh/v1/job.grpc.pb.h"
#include "remesh/v1/queue.grpc.pb.h"
#include "server/http/call.h"

namespace remesh::http {

/// The newest jobs of whoever asks, those that run, and the queue in numbers, once a second, for
/// any number of watchers at the price of one. Idle when nobody watches.
class QueueFeed {
public:
    /// What watchers of one credential share.
    struct Page {
        std::uint64_t version = 0;  ///< Rises with every change of the others.
        std::string json{};         ///< A ListJobsResponse; jobs without histograms and options.
        std::string summary{};      ///< A SummarizeQueueResponse.
        grpc::Status status{};      ///< Why there is no page.
    };

    QueueFeed(v1::JobService::Stub& jobs, v1::QueueService::Stub& queue, OpenCalls& calls);
    QueueFeed(const QueueFeed&) = delete;
    QueueFeed& operator=(const QueueFeed&) = delete;
    ~QueueFeed();

    /// Keeps the page of a credential fresh for as long as it lives.
    class Subscription {
    public:
        Subscription(QueueFeed& feed, std::string token);
        Subscription(const Subscription&) = delete;
        Subscription& operator=(const Subscription&) = delete;
        ~Subscription();

        /// Waits for a page that isn't the one of `version`. \return nothing if none came in time
        std::optional<Page> next(std::uint64_t version, std::chrono::milliseconds timeout);

    private:
        QueueFeed& feed_;
        const std::string token_;
    };

    void close();
    [[nodiscard]] bool is_closed() const;

private:
    struct Channel {
        int watchers = 0;
        Page page{};
    };

    void run(const std::stop_token& stop);
    [[nodiscard]] Page fetch(const std::string& token);
    /// The newest jobs, those in some states or all.
    grpc::Status list(const std::string& token, std::initializer_list<v1::Job::State> states,
                      v1::ListJobsResponse* reply);

    v1::JobService::Stub& jobs_;
    v1::QueueService::Stub& queue_;
    OpenCalls& calls_;
    mutable std::mutex mutex_;
    std::condition_variable_any changed_;
    std::map<std::string, Channel> channels_;  // needs mutex_
    std::uint64_t arrivals_ = 0;               // needs mutex_
    bool is_closed_ = false;                   // needs mutex_
    std::jthread thread_;
};

/// Takes out what a table of jobs doesn't show.
void shorten(v1::Job& job);

}  // namespace remesh::http
