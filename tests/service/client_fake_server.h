#pragma once

#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "remesh/v1/artifact.grpc.pb.h"
#include "remesh/v1/capability.grpc.pb.h"
#include "remesh/v1/job.grpc.pb.h"

namespace remesh::client {

/// A server that meshes nothing: it plays the contract on a real channel, from a script, and keeps
/// what it was asked. Whatever it serves can be told to fail first.
class FakeServer final : public v1::JobService::Service,
                         public v1::ArtifactService::Service,
                         public v1::CapabilityService::Service {
public:
    /// \param listen  HOST:PORT (port 0: any) or unix:PATH
    explicit FakeServer(std::string listen = "127.0.0.1:0");
    ~FakeServer() override;

    [[nodiscard]] std::string address() const;

    // The script. Set before the client starts.
    v1::Job::State outcome = v1::Job::STATE_SUCCEEDED;  ///< RUNNING: until somebody cancels.
    v1::Failure failure{};                              ///< If `outcome` is FAILED.
    std::string failing_content{};  ///< Inputs with these bytes fail; empty: `outcome` for all.
    std::deque<grpc::Status> create_errors{};  ///< Answers of the first CreateJob calls.
    int events_before_break = 0;               ///< > 0: the first watch breaks after so many.
    grpc::Status break_error{grpc::StatusCode::UNAVAILABLE, "shutting down"};  ///< With this.
    std::int64_t bytes_before_break = 0;  ///< > 0: the first download breaks after so many.
    bool corrupts_downloads = false;
    double chosen_edge_length = 1.25;
    bool keeps_first_created = true;  ///< False: the first CreateJob makes the job, then fails.

    // What happened. Read after the client has ended, or with `wait_for_watch`.
    [[nodiscard]] std::vector<v1::CreateJobRequest> creates();
    [[nodiscard]] std::vector<v1::Job> jobs();
    [[nodiscard]] std::vector<std::int64_t> watches();    ///< after_sequence of each.
    [[nodiscard]] std::vector<std::int64_t> downloads();  ///< offset of each.
    [[nodiscard]] int uploads_with_bytes();
    [[nodiscard]] std::vector<std::string> authorizations();  ///< Of each CreateJob.
    void wait_for_watch();
    /// Adds a finished job without a client.
    v1::Job add_job(v1::Job job);
    /// What the output of `format` holds for every job that succeeds.
    [[nodiscard]] static std::string content_of(v1::Format format);

private:
    grpc::Status CreateJob(grpc::ServerContext*, const v1::CreateJobRequest*, v1::Job*) override;
    grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest*, v1::Job*) override;
    grpc::Status ListJobs(grpc::ServerContext*, const v1::ListJobsRequest*,
                          v1::ListJobsResponse*) override;
    grpc::Status WatchJob(grpc::ServerContext*, const v1::WatchJobRequest*,
                          grpc::ServerWriter<v1::JobEvent>*) override;
    grpc::Status CancelJob(grpc::ServerContext*, const v1::CancelJobRequest*, v1::Job*) override;
    grpc::Status DeleteJob(grpc::ServerContext*, const v1::DeleteJobRequest*,
                           v1::DeleteJobResponse*) override;
    grpc::Status UploadArtifact(grpc::ServerContext*,
                                grpc::ServerReader<v1::UploadArtifactRequest>*,
                                v1::UploadArtifactResponse*) override;
    grpc::Status DownloadArtifact(grpc::ServerContext*, const v1::DownloadArtifactRequest*,
                                  grpc::ServerWriter<v1::DownloadArtifactResponse>*) override;
    grpc::Status GetCapabilities(grpc::ServerContext*, const v1::GetCapabilitiesRequest*,
                                 v1::GetCapabilitiesResponse*) override;

    v1::Job finished(v1::Job job);              // needs mutex_
    v1::Digest store(const std::string& data);  // needs mutex_

    std::string listen_;
    int port_ = 0;
    std::unique_ptr<grpc::Server> server_;
    std::mutex mutex_;
    std::condition_variable changed_;
    // Guarded by mutex_:
    std::map<std::string, std::string> artifacts_;
    std::map<std::string, std::string> job_of_request_;
    std::map<std::string, v1::Job> jobs_;
    std::vector<std::string> authorizations_;
    std::vector<v1::CreateJobRequest> creates_;
    std::vector<std::int64_t> watches_;
    std::vector<std::int64_t> downloads_;
    int uploads_with_bytes_ = 0;
};

}  // namespace remesh::client
