#pragma once

#include <string>

#include "remesh/v1/capability.grpc.pb.h"
#include "remesh/v1/job.grpc.pb.h"
#include "server/auth/gate.h"
#include "server/executor.h"
#include "server/jobs/registry.h"
#include "server/page_tokens.h"
#include "server/queue_watch.h"
#include "server/reception.h"
#include "server/watch_stream.h"

namespace remesh {

/// Lets the caller in, converts, calls the registry, converts back. The tenant is the caller's.
/// WatchJob sends bytes, which its streams share, instead of messages.
class JobService final
    : public v1::JobService::WithRawCallbackMethod_WatchJob<v1::JobService::CallbackService> {
public:
    JobService(Gate& gate, JobRegistry& registry, ArtifactStore& artifacts, WatchHub& watches,
               QueueHub& queue_watches, Executor& executor, Reception& reception);

    grpc::ServerUnaryReactor* CreateJob(grpc::CallbackServerContext* context,
                                        const v1::CreateJobRequest* request,
                                        v1::Job* reply) override;
    grpc::ServerUnaryReactor* GetJob(grpc::CallbackServerContext* context,
                                     const v1::GetJobRequest* request, v1::Job* reply) override;
    grpc::ServerUnaryReactor* ListJobs(grpc::CallbackServerContext* context,
                                       const v1::ListJobsRequest* request,
                                       v1::ListJobsResponse* reply) override;
    grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchJob(grpc::CallbackServerContext* context,
                                                         const grpc::ByteBuffer* request) override;
    grpc::ServerWriteReactor<v1::QueueEvent>* WatchQueue(
        grpc::CallbackServerContext* context, const v1::WatchQueueRequest* request) override;
    grpc::ServerUnaryReactor* CancelJob(grpc::CallbackServerContext* context,
                                        const v1::CancelJobRequest* request,
                                        v1::Job* reply) override;
    grpc::ServerUnaryReactor* RetryJob(grpc::CallbackServerContext* context,
                                       const v1::RetryJobRequest* request, v1::Job* reply) override;
    grpc::ServerUnaryReactor* DeleteJob(grpc::CallbackServerContext* context,
                                        const v1::DeleteJobRequest* request,
                                        v1::DeleteJobResponse* reply) override;

private:
    /// Fills in the size of an artifact, so that equal specs have equal bytes.
    void complete(v1::Digest& digest, const std::string& tenant, const std::string& field) const;
    v1::Job create(const std::string& tenant, const v1::CreateJobRequest& request);
    v1::ListJobsResponse list(const std::string& tenant, const v1::ListJobsRequest& request);

    Gate& gate_;
    JobRegistry& registry_;
    ArtifactStore& artifacts_;
    WatchHub& watches_;
    QueueHub& queue_watches_;
    Executor& executor_;
    Reception& reception_;
    const PageTokens page_tokens_;
};

/// What CapabilityService tells besides the engine's formats and defaults.
struct ServerLimits {
    std::int64_t max_artifact_bytes = std::int64_t{2} << 30;
    int workers = 1;
    int threads_per_job = 1;
    std::int64_t max_queued_jobs = 1'000;
};

class CapabilityService final : public v1::CapabilityService::CallbackService {
public:
    CapabilityService(Reception& reception, const ServerLimits& limits);

    grpc::ServerUnaryReactor* GetCapabilities(grpc::CallbackServerContext* context,
                                              const v1::GetCapabilitiesRequest* request,
                                              v1::GetCapabilitiesResponse* reply) override;

private:
    Reception& reception_;
    v1::GetCapabilitiesResponse capabilities_;
};

}  // namespace remesh
