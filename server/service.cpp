#include "server/service.h"

#include <charconv>
#include <exception>
#include <utility>

#include "server/artifact_service.h"
#include "server/convert.h"
#include "server/version.h"

namespace remesh {
namespace {

constexpr std::int32_t kDefaultPageSize = 100;
constexpr std::int32_t kMaxPageSize = 1'000;
constexpr std::size_t kMaxRequestId = 128;

/// Runs `handler` where it may block and finishes the call with what it returns or throws.
template <typename Handler>
grpc::ServerUnaryReactor* finish_with(grpc::CallbackServerContext* context, Executor& executor,
                                      Handler handler) {
    auto* reactor = context->DefaultReactor();
    executor.post([reactor, handler = std::move(handler)] {
        grpc::Status status;
        try {
            handler();
        } catch (...) {
            status = to_status(std::current_exception());
        }
        reactor->Finish(status);
    });
    return reactor;
}

[[noreturn]] void refuse(const std::string& field, const std::string& message) {
    throw JobError({FieldProblem{field, field + " " + message}});
}

void check_request_id(const std::string& id) {
    if (id.size() > kMaxRequestId) {
        refuse("request_id", "must have at most 128 characters, got " + std::to_string(id.size()));
    }
}

std::int64_t page_of(const std::string& token) {
    std::int64_t before = 0;
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), before);
    if (error != std::errc{} || end != token.data() + token.size() || before < 1) {
        refuse("page_token", "must be one that the server gave");
    }
    return before;
}

}  // namespace

JobService::JobService(JobRegistry& registry, ArtifactStore& artifacts, WatchHub& watches,
                       Executor& executor)
    : registry_(registry), artifacts_(artifacts), watches_(watches), executor_(executor) {}

v1::Job JobService::create(const v1::CreateJobRequest& request) {
    check_request_id(request.request_id());
    JobRegistry::Submission submission{
        tenant_of(request.parent()), request.request_id(), {}, request.validate_only()};
    v1::JobSpec spec = request.spec();
    auto* digest = spec.mutable_input()->mutable_digest();
    if (const auto known = artifacts_.find(submission.tenant, digest->sha256())) {
        if (digest->size_bytes() != 0 && digest->size_bytes() != known->size) {
            refuse("spec.input.digest.size_bytes",
                   "must be that of the artifact, got " + std::to_string(digest->size_bytes()));
        }
        digest->set_size_bytes(known->size);
    }
    submission.spec = canonical_spec(spec);
    try {
        return to_proto(registry_.submit(submission));
    } catch (const JobError& error) {
        if (error.code() != JobErrorCode::BadRequest) {
            throw;
        }
        auto problems = error.problems();
        for (FieldProblem& problem : problems) {
            problem.field = proto_field(problem.field);
        }
        throw JobError(std::move(problems));
    }
}

grpc::ServerUnaryReactor* JobService::CreateJob(grpc::CallbackServerContext* context,
                                                const v1::CreateJobRequest* request,
                                                v1::Job* reply) {
    return finish_with(context, executor_, [=, this] { *reply = create(*request); });
}

grpc::ServerUnaryReactor* JobService::GetJob(grpc::CallbackServerContext* context,
                                             const v1::GetJobRequest* request, v1::Job* reply) {
    return finish_with(context, executor_, [=, this] {
        *reply = to_proto(registry_.get(job_key_of(request->name())));
    });
}

v1::ListJobsResponse JobService::list(const v1::ListJobsRequest& request) {
    if (request.page_size() < 0 || request.page_size() > kMaxPageSize) {
        refuse("page_size", "must be in [0, 1000], got " + std::to_string(request.page_size()));
    }
    const auto size =
        static_cast<std::size_t>(request.page_size() == 0 ? kDefaultPageSize : request.page_size());
    ListQuery query{tenant_of(request.parent())};
    for (const int state : request.states()) {
        query.states.push_back(to_core(static_cast<v1::Job::State>(state)));
    }
    if (!request.page_token().empty()) {
        query.before = page_of(request.page_token());
    }
    query.limit = size + 1;  // one more tells whether there is a next page
    auto jobs = registry_.list(query);
    v1::ListJobsResponse reply;
    if (jobs.size() > size) {
        jobs.resize(size);
        reply.set_next_page_token(std::to_string(jobs.back().job.number));
    }
    for (const JobView& job : jobs) {
        *reply.add_jobs() = to_proto(job);
    }
    return reply;
}

grpc::ServerUnaryReactor* JobService::ListJobs(grpc::CallbackServerContext* context,
                                               const v1::ListJobsRequest* request,
                                               v1::ListJobsResponse* reply) {
    return finish_with(context, executor_, [=, this] { *reply = list(*request); });
}

grpc::ServerWriteReactor<v1::JobEvent>* JobService::WatchJob(grpc::CallbackServerContext*,
                                                             const v1::WatchJobRequest* request) {
    return watches_.open(*request);
}

grpc::ServerUnaryReactor* JobService::CancelJob(grpc::CallbackServerContext* context,
                                                const v1::CancelJobRequest* request,
                                                v1::Job* reply) {
    return finish_with(context, executor_, [=, this] {
        *reply = to_proto(registry_.cancel(job_key_of(request->name())));
    });
}

grpc::ServerUnaryReactor* JobService::RetryJob(grpc::CallbackServerContext* context,
                                               const v1::RetryJobRequest* request, v1::Job* reply) {
    return finish_with(context, executor_, [=, this] {
        check_request_id(request->request_id());
        *reply = to_proto(registry_.retry(job_key_of(request->name()), request->request_id()));
    });
}

grpc::ServerUnaryReactor* JobService::DeleteJob(grpc::CallbackServerContext* context,
                                                const v1::DeleteJobRequest* request,
                                                v1::DeleteJobResponse*) {
    return finish_with(context, executor_, [=, this] {
        const auto revision =
            request->etag().empty() ? std::nullopt : std::optional(revision_of(request->etag()));
        registry_.remove(job_key_of(request->name()), revision);
    });
}

CapabilityService::CapabilityService(const ServerLimits& limits) {
    capabilities_.set_server_version(kVersion);
    capabilities_.set_api_version("v1");
    for (const MeshFormat format :
         {MeshFormat::Stl, MeshFormat::Ply, MeshFormat::Obj, MeshFormat::Off, MeshFormat::Vtp,
          MeshFormat::Vtu, MeshFormat::Vtk, MeshFormat::Msh41, MeshFormat::Msh22, MeshFormat::Medit,
          MeshFormat::Gifti}) {
        auto* to = capabilities_.add_formats();
        to->set_format(to_proto(format));
        to->set_extension(std::string(format_extension(format)));
        to->set_can_read(can_read(format));
        to->set_can_write_surface(can_write_surface(format));
        to->set_can_write_tetrahedra(can_write_tets(format));
    }
    *capabilities_.mutable_default_options() = to_proto(RemeshOptions{});
    capabilities_.set_max_artifact_bytes(limits.max_artifact_bytes);
    capabilities_.set_max_chunk_bytes(static_cast<std::int32_t>(kMaxChunkBytes));
    capabilities_.set_workers(limits.workers);
    capabilities_.set_threads_per_job(limits.threads_per_job);
    capabilities_.set_max_queued_jobs(static_cast<std::int32_t>(limits.max_queued_jobs));
}

grpc::ServerUnaryReactor* CapabilityService::GetCapabilities(grpc::CallbackServerContext* context,
                                                             const v1::GetCapabilitiesRequest*,
                                                             v1::GetCapabilitiesResponse* reply) {
    *reply = capabilities_;
    auto* reactor = context->DefaultReactor();
    reactor->Finish(grpc::Status::OK);
    return reactor;
}

}  // namespace remesh
