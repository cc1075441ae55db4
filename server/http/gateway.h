#pragma once

#include <grpcpp/channel.h>

#include <atomic>
#include <memory>
#include <string>

#include "remesh/v1/artifact.grpc.pb.h"
#include "remesh/v1/capability.grpc.pb.h"
#include "remesh/v1/job.grpc.pb.h"
#include "remesh/v1/queue.grpc.pb.h"
#include "server/http/access.h"
#include "server/http/call.h"
#include "server/http/queue_feed.h"

namespace httplib {
class ContentReader;
class Server;
}  // namespace httplib

namespace remesh::http {

/// The API for browsers: each route is one call of remesh.v1 with its messages as JSON, made with
/// the caller's own token. Rights, limits and errors are those of the API; nothing is decided here.
class Gateway {
public:
    Gateway(const std::shared_ptr<grpc::Channel>& channel, const AccessRules& rules);
    Gateway(const Gateway&) = delete;
    Gateway& operator=(const Gateway&) = delete;
    ~Gateway();

    void add_routes(httplib::Server& server);
    /// Ends the event streams, present and future.
    void close();
    /// Whether the API takes a token; an empty one stands for none.
    [[nodiscard]] grpc::Status check(const std::string& token);

private:
    void add_job_routes(httplib::Server& server);
    void add_artifact_routes(httplib::Server& server);
    void add_session_routes(httplib::Server& server);
    void add_streams(httplib::Server& server);
    void list_jobs(const httplib::Request& request, httplib::Response& response);
    void upload(const httplib::Request& request, httplib::Response& response,
                const httplib::ContentReader& content);
    void download(const httplib::Request& request, httplib::Response& response);
    void stream_job(const httplib::Request& request, httplib::Response& response);

    const AccessRules rules_;
    std::unique_ptr<v1::JobService::Stub> jobs_;
    std::unique_ptr<v1::ArtifactService::Stub> artifacts_;
    std::unique_ptr<v1::CapabilityService::Stub> capabilities_;
    std::unique_ptr<v1::QueueService::Stub> summaries_;
    OpenCalls calls_;
    QueueFeed queue_;
    std::atomic<int> streams_{0};
};

}  // namespace remesh::http
