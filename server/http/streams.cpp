#include <charconv>
#include <chrono>
#include <httplib.h>
#include <memory>
#include <string>
#include <utility>

#include "server/http/gateway.h"
#include "server/http/respond.h"

// Server-sent events: what a browser follows a job and the queue with.

namespace remesh::http {
namespace {

// Each holds a thread; a browser holds one a visible tab.
constexpr int kMaxStreams = 200;
// A comment, so that proxies don't take a silent stream for a dead one.
constexpr std::chrono::seconds kHeartbeat{15};

/// Counts the streams that are open.
class StreamSlot {
public:
    explicit StreamSlot(std::atomic<int>& streams) : streams_(streams), rank_(++streams) {}
    StreamSlot(const StreamSlot&) = delete;
    StreamSlot& operator=(const StreamSlot&) = delete;
    ~StreamSlot() { --streams_; }

    [[nodiscard]] bool is_granted() const { return rank_ <= kMaxStreams; }

private:
    std::atomic<int>& streams_;
    const int rank_;
};

bool write(httplib::DataSink& sink, const std::string& text) {
    return sink.write(text.data(), text.size());
}

const char* name_of(const v1::JobEvent& event) {
    switch (event.event_case()) {
        case v1::JobEvent::kSnapshot: return "snapshot";
        case v1::JobEvent::kProgress: return "progress";
        case v1::JobEvent::kSample: return "sample";
        case v1::JobEvent::kWarning: return "warning";
        case v1::JobEvent::kPreview: return "preview";
        case v1::JobEvent::kCompleted: return "completed";
        case v1::JobEvent::kHeartbeat:
        case v1::JobEvent::EVENT_NOT_SET: break;
    }
    return nullptr;
}

/// JSON has no line breaks, so it's one data line.
std::string framed(const v1::JobEvent& event) {
    const char* name = name_of(event);
    if (name == nullptr) {
        return ": alive\n\n";
    }
    std::string text;
    if (event.sequence() > 0) {
        text += "id: " + std::to_string(event.sequence()) + '\n';
    }
    return text + "event: " + name + "\ndata: " + to_json(event) + "\n\n";
}

std::string framed_error(const std::string& error) {
    return "event: refused\ndata: " + error + "\n\n";
}

void start_stream(httplib::Response& response, httplib::ContentProviderWithoutLength provider) {
    response.set_header("X-Accel-Buffering", "no");
    response.set_chunked_content_provider("text/event-stream", std::move(provider));
}

/// Where a stream goes on: what a browser says when it reconnects, else what the page asks for.
std::int64_t cursor_of(const httplib::Request& request) {
    const std::string text = request.has_header("Last-Event-ID")
                                 ? request.get_header_value("Last-Event-ID")
                                 : request.get_param_value("after");
    std::int64_t sequence = 0;
    std::from_chars(text.data(), text.data() + text.size(), sequence);
    return sequence;
}

}  // namespace

void Gateway::add_streams(httplib::Server& server) {
    server.Get(R"(/api/v1/(tenants/[a-z0-9-]+/jobs/[a-z0-9-]+)/events)",
               [this](const httplib::Request& request, httplib::Response& response) {
                   stream_job(request, response);
               });
    server.Get(
        "/api/v1/events", [this](const httplib::Request& request, httplib::Response& response) {
            const auto slot = std::make_shared<StreamSlot>(streams_);
            const std::string token = token_of(request);
            if (!slot->is_granted()) {
                response.set_header("Retry-After", "5");
                refuse(response, 503, "TOO_MANY_STREAMS", "Too many pages follow the queue.");
                return;
            }
            if (const grpc::Status status = check(token); !status.ok()) {
                refuse(response, status);
                return;
            }
            const auto subscription = std::make_shared<QueueFeed::Subscription>(queue_, token);
            const auto version = std::make_shared<std::uint64_t>(0);
            start_stream(response, [this, slot, subscription, version](std::size_t,
                                                                       httplib::DataSink& sink) {
                const auto page = subscription->next(*version, kHeartbeat);
                if (queue_.is_closed()) {
                    sink.done();
                    return true;
                }
                if (!page) {
                    return write(sink, ": alive\n\n");
                }
                *version = page->version;
                if (!page->status.ok()) {
                    write(sink, framed_error(page->json));
                    sink.done();
                    return true;
                }
                return write(sink, "event: jobs\ndata: " + page->json +
                                       "\n\nevent: summary\ndata: " + page->summary + "\n\n");
            });
        });
}

void Gateway::stream_job(const httplib::Request& request, httplib::Response& response) {
    struct Watch {
        Watch(std::atomic<int>& streams, OpenCalls& calls, const std::string& token)
            : slot(streams), call(calls, token) {}
        StreamSlot slot;
        StreamCall<v1::JobEvent> call;
        v1::JobEvent event{};
        bool is_first = true;
    };
    const auto watch = std::make_shared<Watch>(streams_, calls_, token_of(request));
    if (!watch->slot.is_granted()) {
        response.set_header("Retry-After", "5");
        refuse(response, 503, "TOO_MANY_STREAMS", "Too many pages follow jobs.");
        return;
    }
    v1::WatchJobRequest watch_request;
    watch_request.set_name(request.matches[1]);
    watch_request.set_after_sequence(cursor_of(request));
    watch->call.start(jobs_->WatchJob(watch->call.context(), watch_request));
    // Refusals are told as a status, not as an event: EventSource gives up on those.
    if (!watch->call.read(&watch->event)) {
        refuse(response, watch->call.finish());
        return;
    }
    start_stream(response, [watch](std::size_t, httplib::DataSink& sink) {
        if (!std::exchange(watch->is_first, false) && !watch->call.read(&watch->event)) {
            const grpc::Status status = watch->call.finish();
            if (!status.ok() && status.error_code() != grpc::StatusCode::UNAVAILABLE &&
                status.error_code() != grpc::StatusCode::CANCELLED) {
                write(sink, framed_error(to_json(status)));
            }
            sink.done();
            return true;
        }
        return write(sink, framed(watch->event));
    });
}

}  // namespace remesh::http
