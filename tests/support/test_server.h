#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "remesh/v1/artifact.grpc.pb.h"
#include "remesh/v1/capability.grpc.pb.h"
#include "remesh/v1/job.grpc.pb.h"
#include "remesh/v1/queue.grpc.pb.h"
#include "server/auth/access_store.h"
#include "server/server.h"
#include "server/store/digest.h"
#include "tests/support/scripted_engine.h"
#include "tests/support/temporary_directory.h"

namespace remesh::testing {

/// A client's context with a deadline, for one call. What a call takes on a machine that is busy
/// with other things is no part of any test.
class CallContext : public grpc::ClientContext {
public:
    explicit CallContext(const std::string& token = {}) {
        set_deadline(std::chrono::system_clock::now() + std::chrono::minutes(5));
        if (!token.empty()) {
            AddMetadata("authorization", "Bearer " + token);
        }
    }
};

/// A detail of an error, if the error has one of that kind.
template <typename Detail>
std::optional<Detail> detail_of(const grpc::Status& status) {
    google::rpc::Status details;
    details.ParseFromString(status.error_details());
    for (const auto& any : details.details()) {
        Detail detail;
        if (any.UnpackTo(&detail)) {
            return detail;
        }
    }
    return std::nullopt;
}

/// A whole server with an engine of the test's choice, and a client of it. `stop` and `start` are
/// a restart on the same data directory.
class TestServer {
public:
    explicit TestServer(const Engine& engine, const std::function<void(ServerOptions&)>& tune = {})
        : engine_(engine) {
        options_.data_dir = directory_.path();
        options_.listen = "127.0.0.1:0";
        options_.workforce.desk.flush_interval = std::chrono::milliseconds(5);
        if (tune) {
            tune(options_);
        }
        start();
    }
    ~TestServer() { stop(); }

    void start() {
        server_ = std::make_unique<Server>(options_, engine_);
        connect(grpc::InsecureChannelCredentials());
    }
    /// Talks over a connection of its own from now on.
    void connect(const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
        grpc::ChannelArguments arguments;
        arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
        channel = grpc::CreateCustomChannel(address(), credentials, arguments);
        jobs = v1::JobService::NewStub(channel);
        artifacts = v1::ArtifactService::NewStub(channel);
        capabilities = v1::CapabilityService::NewStub(channel);
        queue = v1::QueueService::NewStub(channel);
    }
    [[nodiscard]] const std::filesystem::path& data_dir() const { return directory_.path(); }
    /// Makes a token that is valid at once.
    [[nodiscard]] std::string token_for(const std::string& tenant, Role role = Role::User) const {
        return AccessStore(data_dir()).create_token({tenant, role, "", {}}, system_now()).token;
    }
    void stop() { server_.reset(); }
    [[nodiscard]] Server& server() { return *server_; }
    [[nodiscard]] std::string address() const {
        return "127.0.0.1:" + std::to_string(server_->port());
    }

    grpc::Status upload(const std::string& bytes, const v1::Digest& digest,
                        v1::UploadArtifactResponse* response, std::size_t chunk = 1U << 20U) {
        CallContext context(token);
        const auto stream = artifacts->UploadArtifact(&context, response);
        v1::UploadArtifactRequest request;
        *request.mutable_digest() = digest;
        std::size_t offset = 0;
        do {
            request.set_offset(static_cast<std::int64_t>(offset));
            request.set_data(bytes.substr(offset, chunk));
            offset += request.data().size();
            if (!stream->Write(request)) {
                break;
            }
            request.clear_digest();
        } while (offset < bytes.size());
        stream->WritesDone();
        return stream->Finish();
    }
    v1::Digest upload(const std::string& bytes) {
        v1::Digest digest;
        digest.set_sha256(sha256_of(bytes));
        digest.set_size_bytes(static_cast<std::int64_t>(bytes.size()));
        v1::UploadArtifactResponse response;
        upload(bytes, digest, &response);
        return digest;
    }
    /// Uploads an input and asks for one STL of it.
    v1::CreateJobRequest request_for(const std::string& bytes) {
        v1::CreateJobRequest request;
        *request.mutable_spec()->mutable_input()->mutable_digest() = upload(bytes);
        request.mutable_spec()->mutable_input()->set_file_name("input.stl");
        request.mutable_spec()->add_outputs()->set_format(v1::FORMAT_STL);
        return request;
    }
    grpc::Status create(const v1::CreateJobRequest& request, v1::Job* job) {
        CallContext context(token);
        return jobs->CreateJob(&context, request, job);
    }
    v1::Job create(const std::string& bytes) {
        v1::Job job;
        create(request_for(bytes), &job);
        return job;
    }
    grpc::Status get(const std::string& name, v1::Job* job) {
        CallContext context(token);
        v1::GetJobRequest request;
        request.set_name(name);
        return jobs->GetJob(&context, request, job);
    }
    grpc::Status cancel(const std::string& name, v1::Job* job) {
        CallContext context(token);
        v1::CancelJobRequest request;
        request.set_name(name);
        return jobs->CancelJob(&context, request, job);
    }
    grpc::Status remove(const std::string& name, const std::string& etag = "") {
        CallContext context(token);
        v1::DeleteJobRequest request;
        request.set_name(name);
        request.set_etag(etag);
        v1::DeleteJobResponse response;
        return jobs->DeleteJob(&context, request, &response);
    }
    grpc::Status download(const std::string& sha256, std::int64_t offset, std::int64_t limit,
                          std::string* bytes) {
        CallContext context(token);
        v1::DownloadArtifactRequest request;
        request.set_sha256(sha256);
        request.set_offset(offset);
        request.set_limit(limit);
        const auto stream = artifacts->DownloadArtifact(&context, request);
        v1::DownloadArtifactResponse chunk;
        while (stream->Read(&chunk)) {
            bytes->append(chunk.data());
        }
        return stream->Finish();
    }
    /// Reads events until `is_enough` or the end of the stream.
    std::vector<v1::JobEvent> watch(
        const std::string& name, std::int64_t after = 0, grpc::Status* status = nullptr,
        const std::function<bool(const v1::JobEvent&)>& is_enough = {}) {
        CallContext context(token);
        v1::WatchJobRequest request;
        request.set_name(name);
        request.set_after_sequence(after);
        const auto stream = jobs->WatchJob(&context, request);
        std::vector<v1::JobEvent> events;
        v1::JobEvent event;
        while (stream->Read(&event)) {
            events.push_back(event);
            if (is_enough && is_enough(event)) {
                context.TryCancel();
            }
        }
        const grpc::Status end = stream->Finish();
        if (status != nullptr) {
            *status = end;
        }
        return events;
    }
    void wait_for(const std::string& name, v1::Job::State state) {
        watch(name, 0, nullptr, [&](const v1::JobEvent& event) {
            return event.snapshot().state() == state || event.completed().state() == state;
        });
    }

    std::string token{};  ///< Of the calls that this makes; empty: none.
    std::shared_ptr<grpc::Channel> channel{};
    std::unique_ptr<v1::JobService::Stub> jobs{};
    std::unique_ptr<v1::ArtifactService::Stub> artifacts{};
    std::unique_ptr<v1::CapabilityService::Stub> capabilities{};
    std::unique_ptr<v1::QueueService::Stub> queue{};

private:
    TemporaryDirectory directory_;
    const Engine& engine_;
    ServerOptions options_;
    std::unique_ptr<Server> server_;
};

}  // namespace remesh::testing
