#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "client/credentials.h"
#include "remesh/v1/artifact.pb.h"
#include "remesh/v1/capability.pb.h"
#include "remesh/v1/job.pb.h"

namespace grpc {
class ClientContext;
class Status;
}  // namespace grpc

namespace remesh::client {

struct Stubs;

/// Where a server is and how to talk to it.
struct ServerSettings {
    std::string address{};  ///< "HOST:PORT" or "unix:PATH".
    Credentials credentials{};
    /// How long a silent server is waited for; absent: a few seconds for the first contact, then
    /// long enough for it to be restarted.
    std::optional<std::chrono::milliseconds> patience{};
    /// Whether waiting is pointless: asked before each pause. Empty: it never is.
    std::function<bool()> is_gone{};
};

/// One server, and what to do while it can't be reached.
///
/// Every call that answers UNAVAILABLE, or that others do too much at a time, is tried again, with
/// growing pauses, until the server has been of no use for longer than the patience. All calls are
/// safe to repeat: the contract makes them idempotent, and CreateJob carries a request id.
class Connection {
public:
    using Attempt = std::function<grpc::Status(grpc::ClientContext&)>;
    using Milliseconds = std::chrono::milliseconds;

    /// \param stop  ends calls and pauses at once
    /// \throws Failure{Usage} if the address is none, or the credentials can't be read or sent
    Connection(ServerSettings server, std::stop_token stop);
    ~Connection();
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    [[nodiscard]] v1::GetCapabilitiesResponse capabilities();
    [[nodiscard]] v1::Job create_job(const v1::CreateJobRequest& request);
    [[nodiscard]] v1::Job get_job(const std::string& name);
    [[nodiscard]] v1::Inspection inspect(const v1::InspectArtifactRequest& request);
    [[nodiscard]] v1::ListJobsResponse list_jobs(const v1::ListJobsRequest& request);
    [[nodiscard]] v1::Job cancel_job(const std::string& name);
    [[nodiscard]] v1::Job retry_job(const v1::RetryJobRequest& request);
    void delete_job(const std::string& name);

    /// Tries a call until it succeeds, one attempt at least.
    ///
    /// \param limit  longest time of one attempt
    /// \throws Failure that says why it didn't; Failure{Interrupted} if asked to stop
    void retry(Milliseconds limit, const Attempt& attempt);

    /// Gives a call of one's own what every attempt gets: a deadline and the token.
    void prepare(grpc::ClientContext& context, Milliseconds limit) const;

    /// Says that the server answered in the middle of an attempt, so that patience starts anew.
    void note_contact();

    /// Calls `listener` with the patience once a call has waited for a second.
    void set_on_silence(std::function<void(Milliseconds)> listener) {
        on_silence_ = std::move(listener);
    }

    /// Listens to another token from now on: what the user does after a first interrupt.
    void set_stop(std::stop_token stop) { stop_ = std::move(stop); }

    /// For streams; see client/stubs.h.
    [[nodiscard]] Stubs& stubs() { return *stubs_; }
    [[nodiscard]] const std::string& server() const { return server_.address; }

private:
    using Clock = std::chrono::steady_clock;

    grpc::Status attempt_once(Milliseconds limit, const Attempt& attempt);
    void pause(Milliseconds duration) const;

    ServerSettings server_;
    std::string token_;
    std::stop_token stop_;
    std::function<void(Milliseconds)> on_silence_;
    std::unique_ptr<Stubs> stubs_;
    std::optional<Clock::time_point> last_contact_;
};

}  // namespace remesh::client
