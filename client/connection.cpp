#include "client/connection.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "client/error_details.h"
#include "client/failure.h"
#include "client/stubs.h"
#include "client/text.h"

namespace remesh::client {
namespace {

using namespace std::chrono_literals;

constexpr Connection::Milliseconds kUnaryLimit = 30s;
constexpr Connection::Milliseconds kInspectionLimit = 180s;
constexpr Connection::Milliseconds kFirstContactPatience = 10s;
constexpr Connection::Milliseconds kRestartPatience = 120s;
constexpr Connection::Milliseconds kQuietSilence = 1s;  ///< Longer than this is worth a word.
constexpr Connection::Milliseconds kShortestPause = 50ms;
constexpr Connection::Milliseconds kStopInterval = 50ms;  ///< A stop takes effect within it.
constexpr Connection::Milliseconds kLongestPause = 500ms;
constexpr Connection::Milliseconds kLongestDelay = 30s;  ///< That a server may ask for.
constexpr int kLookaheadBytes = 4 << 20;  ///< Of a download, on their way before they are read.

bool is_port(std::string_view text) {
    return !text.empty() && text.size() <= 5 &&
           std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

void require_address(const std::string& server) {
    const std::size_t colon = server.rfind(':');
    const bool is_socket = server.starts_with("unix:") && server.size() > 5;
    const bool is_host =
        colon != std::string::npos && colon > 0 && is_port(server.substr(colon + 1));
    if (!is_socket && !is_host) {
        throw Failure(
            ExitCode::Usage,
            fmt::format("--server must be HOST:PORT or unix:PATH, got {}", sanitised(server)));
    }
}

std::shared_ptr<grpc::Channel> open_channel(const ServerSettings& server) {
    grpc::ChannelArguments arguments;
    // Hospital networks set http_proxy for browsers; a mesh server is never behind it.
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
    arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 50);
    // In spite of its name the time that one attempt to connect gets.
    arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 5000);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 500);
    arguments.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, kLookaheadBytes);
    return grpc::CreateCustomChannel(server.address, channel_credentials(server.credentials),
                                     arguments);
}

template <typename Stub, typename Request, typename Response>
Response call(Connection& connection, Stub& stub,
              grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
              const Request& request, Connection::Milliseconds limit = kUnaryLimit) {
    Response response;
    connection.retry(limit, [&](grpc::ClientContext& context) {
        return (stub.*method)(&context, request, &response);
    });
    return response;
}

}  // namespace

Connection::Connection(ServerSettings server, std::stop_token stop)
    : server_(std::move(server)), stop_(std::move(stop)) {
    require_address(server_.address);
    token_ = token_for(server_.address, server_.credentials);
    stubs_ = std::make_unique<Stubs>(open_channel(server_));
}

Connection::~Connection() = default;

v1::GetCapabilitiesResponse Connection::capabilities() {
    return call(*this, stubs_->capabilities, &v1::CapabilityService::Stub::GetCapabilities,
                v1::GetCapabilitiesRequest());
}

v1::Job Connection::create_job(const v1::CreateJobRequest& request) {
    return call(*this, stubs_->jobs, &v1::JobService::Stub::CreateJob, request,
                request.validate_only() ? kInspectionLimit : kUnaryLimit);
}

v1::Job Connection::get_job(const std::string& name) {
    v1::GetJobRequest request;
    request.set_name(name);
    return call(*this, stubs_->jobs, &v1::JobService::Stub::GetJob, request);
}

v1::Inspection Connection::inspect(const v1::InspectArtifactRequest& request) {
    return call(*this, stubs_->artifacts, &v1::ArtifactService::Stub::InspectArtifact, request,
                kInspectionLimit);
}

v1::ListJobsResponse Connection::list_jobs(const v1::ListJobsRequest& request) {
    return call(*this, stubs_->jobs, &v1::JobService::Stub::ListJobs, request);
}

v1::Job Connection::cancel_job(const std::string& name) {
    v1::CancelJobRequest request;
    request.set_name(name);
    return call(*this, stubs_->jobs, &v1::JobService::Stub::CancelJob, request);
}

v1::Job Connection::retry_job(const v1::RetryJobRequest& request) {
    return call(*this, stubs_->jobs, &v1::JobService::Stub::RetryJob, request);
}

void Connection::delete_job(const std::string& name) {
    v1::DeleteJobRequest request;
    request.set_name(name);
    call(*this, stubs_->jobs, &v1::JobService::Stub::DeleteJob, request);
}

void Connection::note_contact() {
    last_contact_ = Clock::now();
}

void Connection::retry(Milliseconds limit, const Attempt& attempt) {
    const Clock::time_point start = Clock::now();
    bool is_noted = false;
    for (Milliseconds wait = kShortestPause;; wait = std::min(2 * wait, kLongestPause)) {
        const grpc::Status status = attempt_once(limit, attempt);
        if (status.ok()) {
            note_contact();
            return;
        }
        if (stop_.stop_requested()) {
            throw Failure(ExitCode::Interrupted, "interrupted");
        }
        const Milliseconds patience =
            server_.patience.value_or(last_contact_ ? kRestartPatience : kFirstContactPatience);
        const auto silence = std::chrono::duration_cast<Milliseconds>(
            Clock::now() - std::max(start, last_contact_.value_or(start)));
        const bool is_hopeless = silence >= patience || (server_.is_gone && server_.is_gone());
        if (!is_passing(status) || is_hopeless) {
            throw to_failure(status, server_.address);
        }
        if (silence >= kQuietSilence && on_silence_ && !std::exchange(is_noted, true)) {
            on_silence_(patience);
        }
        const Milliseconds asked = std::min(retry_delay(status).value_or(wait), kLongestDelay);
        // So that the last attempt ends the patience.
        pause(std::min(std::max(wait, asked), patience - silence));
    }
}

grpc::Status Connection::attempt_once(Milliseconds limit, const Attempt& attempt) {
    grpc::ClientContext context;
    prepare(context, limit);
    const std::stop_callback cancel(stop_, [&] { context.TryCancel(); });
    return attempt(context);
}

void Connection::prepare(grpc::ClientContext& context, Milliseconds limit) const {
    context.set_deadline(std::chrono::system_clock::now() + limit);
    if (!token_.empty()) {
        context.AddMetadata("authorization", "Bearer " + token_);
    }
}

void Connection::pause(Milliseconds duration) const {
    const auto end = std::chrono::system_clock::now() + duration;
    if (stubs_->channel->GetState(false) == GRPC_CHANNEL_READY) {
        std::mutex mutex;
        std::condition_variable_any wake;
        std::unique_lock lock(mutex);
        wake.wait_until(lock, stop_, end, [] { return false; });
    }
    // A channel of blocking calls connects only while somebody waits on it, so sleeping wouldn't
    // do.
    while (std::chrono::system_clock::now() < end && !stop_.stop_requested()) {
        if (stubs_->channel->WaitForConnected(
                std::min(end, std::chrono::system_clock::now() + kStopInterval))) {
            break;
        }
    }
    if (stop_.stop_requested()) {
        throw Failure(ExitCode::Interrupted, "interrupted");
    }
}

}  // namespace remesh::client
