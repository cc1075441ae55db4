#include "server/service.h"

#include <algorithm>
#include <utility>

#include "server/artifact_service.h"
#include "server/call.h"
#include "server/convert.h"
#include "server/open_stream.h"
#include "server/version.h"

namespace remesh {
namespace {

constexpr std::int32_t kDefaultPageSize = 100;
constexpr std::int32_t kMaxPageSize = 1'000;
// Of the jobs on a page, unless a single one has more: clients take 4 MiB a message.
constexpr std::size_t kMaxPageBytes = std::size_t{2} << 20U;
// Jobs that are asked of the store at a time: a spec may have 1.5 MiB.
constexpr std::size_t kBatch = 32;
constexpr std::size_t kMaxRequestId = 128;

// The rules of this service, a line a method.
constexpr Rule kCreate{"CreateJob", Role::User, true};
constexpr Rule kGet{"GetJob", Role::Viewer, false};
constexpr Rule kList{"ListJobs", Role::Viewer, false};
constexpr Rule kWatch{"WatchJob", Role::Viewer, false};
constexpr Rule kWatchQueue{"WatchQueue", Role::Viewer, false};
constexpr Rule kCancel{"CancelJob", Role::User, true};
constexpr Rule kRetry{"RetryJob", Role::User, true};
constexpr Rule kDelete{"DeleteJob", Role::User, true};
constexpr Rule kCapabilities{"GetCapabilities", Role::Viewer, false};

void check_request_id(const std::string& id) {
    if (id.size() > kMaxRequestId) {
        refuse("request_id", "must have at most 128 characters, got " + std::to_string(id.size()));
    }
}

}  // namespace

JobService::JobService(Gate& gate, JobRegistry& registry, ArtifactStore& artifacts,
                       WatchHub& watches, QueueHub& queue_watches, Executor& executor,
                       Reception& reception)
    : gate_(gate),
      registry_(registry),
      artifacts_(artifacts),
      watches_(watches),
      queue_watches_(queue_watches),
      executor_(executor),
      reception_(reception),
      page_tokens_(gate.key_for("pages")) {}

void JobService::complete(v1::Digest& digest, const std::string& tenant,
                          const std::string& field) const {
    if (const auto known = artifacts_.find(tenant, digest.sha256())) {
        if (digest.size_bytes() != 0 && digest.size_bytes() != known->size) {
            refuse(field + ".size_bytes",
                   "must be that of the artifact, got " + std::to_string(digest.size_bytes()));
        }
        digest.set_size_bytes(known->size);
    }
}

v1::Job JobService::create(const std::string& tenant, const v1::CreateJobRequest& request) {
    check_request_id(request.request_id());
    require_own(tenant, request.parent());
    JobRegistry::Submission submission{tenant, request.request_id(), {}, request.validate_only()};
    v1::JobSpec spec = request.spec();
    complete(*spec.mutable_input()->mutable_digest(), tenant, "spec.input.digest");
    if (spec.has_size_image()) {
        complete(*spec.mutable_size_image()->mutable_digest(), tenant, "spec.size_image.digest");
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
    if (request->validate_only()) {  // An estimate takes a look at the input.
        return reception_.inspect({context, request, reply}, kCreate,
                                  [=, this](const Principal& who, std::string&) {
                                      *reply = create(who.tenant, *request);
                                  });
    }
    return reception_.answer({context, request, reply}, kCreate,
                             [=, this](const Principal& who, std::string& subject) {
                                 *reply = create(who.tenant, *request);
                                 subject = reply->name();
                             });
}

grpc::ServerUnaryReactor* JobService::GetJob(grpc::CallbackServerContext* context,
                                             const v1::GetJobRequest* request, v1::Job* reply) {
    return reception_.answer(
        {context, request, reply}, kGet, [=, this](const Principal& who, std::string&) {
            *reply = to_proto(registry_.get(job_key_of(who.tenant, request->name())));
        });
}

v1::ListJobsResponse JobService::list(const std::string& tenant,
                                      const v1::ListJobsRequest& request) {
    require_own(tenant, request.parent());
    if (request.page_size() < 0 || request.page_size() > kMaxPageSize) {
        refuse("page_size", "must be in [0, 1000], got " + std::to_string(request.page_size()));
    }
    const auto size =
        static_cast<std::size_t>(request.page_size() == 0 ? kDefaultPageSize : request.page_size());
    ListQuery query{tenant};
    for (const int state : request.states()) {
        const JobState wanted = to_core(static_cast<v1::Job::State>(state));
        if (std::find(query.states.begin(), query.states.end(), wanted) == query.states.end()) {
            query.states.push_back(wanted);
        }
    }
    if (!request.page_token().empty()) {
        query.before = page_tokens_.open(tenant, request.page_token());
        if (!query.before) {
            refuse("page_token", "must be one that the server gave to this tenant");
        }
    }
    query.limit = std::min(size + 1, kBatch);  // one more tells whether there is a next page
    v1::ListJobsResponse reply;
    std::size_t bytes = 0;
    std::int64_t last = 0;
    while (true) {
        const auto views = registry_.list(query);
        for (const JobView& view : views) {
            v1::Job job = to_proto(view);
            bytes += job.ByteSizeLong();
            if (last != 0 &&
                (static_cast<std::size_t>(reply.jobs_size()) == size || bytes > kMaxPageBytes)) {
                reply.set_next_page_token(page_tokens_.seal(tenant, last));
                return reply;
            }
            last = view.job.number;
            *reply.add_jobs() = std::move(job);
        }
        if (views.size() < query.limit) {
            return reply;
        }
        query.before = last;
    }
}

grpc::ServerUnaryReactor* JobService::ListJobs(grpc::CallbackServerContext* context,
                                               const v1::ListJobsRequest* request,
                                               v1::ListJobsResponse* reply) {
    return reception_.answer(
        {context, request, reply}, kList,
        [=, this](const Principal& who, std::string&) { *reply = list(who.tenant, *request); });
}

grpc::ServerWriteReactor<grpc::ByteBuffer>* JobService::WatchJob(
    grpc::CallbackServerContext* context, const grpc::ByteBuffer* bytes) {
    v1::WatchJobRequest request;
    grpc::ByteBuffer copy(*bytes);
    const bool is_read =
        grpc::SerializationTraits<v1::WatchJobRequest>::Deserialize(&copy, &request).ok();
    request.DiscardUnknownFields();
    const std::size_t size = bytes->Length();
    free_content(*bytes);
    return watches_.open(executor_, [=, this](WatchTarget& target) {
        return guarded(gate_, *context, kWatch, [&](const Principal& who, std::string&) {
            require_small_request(size);
            if (!is_read) {
                refuse("request", "must be a WatchJobRequest");
            }
            target = {who, job_key_of(who.tenant, request.name()), request.after_sequence()};
            if (target.after < 0) {
                refuse("after_sequence", "must be >= 0, got " + std::to_string(target.after));
            }
        });
    });
}

grpc::ServerWriteReactor<v1::QueueEvent>* JobService::WatchQueue(
    grpc::CallbackServerContext* context, const v1::WatchQueueRequest* request) {
    return queue_watches_.open(executor_, [=, this](Principal& caller) {
        const grpc::Status status =
            guarded(gate_, *context, kWatchQueue, [&](const Principal& who, std::string&) {
                require_small_request(request->SpaceUsedLong());
                require_own(who.tenant, request->parent());
                caller = who;
            });
        free_content(*request);
        return status;
    });
}

grpc::ServerUnaryReactor* JobService::CancelJob(grpc::CallbackServerContext* context,
                                                const v1::CancelJobRequest* request,
                                                v1::Job* reply) {
    return reception_.answer({context, request, reply}, kCancel,
                             [=, this](const Principal& who, std::string& subject) {
                                 const JobKey key = job_key_of(who.tenant, request->name());
                                 subject = job_name(key);
                                 *reply = to_proto(registry_.cancel(key));
                             });
}

grpc::ServerUnaryReactor* JobService::RetryJob(grpc::CallbackServerContext* context,
                                               const v1::RetryJobRequest* request, v1::Job* reply) {
    return reception_.answer({context, request, reply}, kRetry,
                             [=, this](const Principal& who, std::string& subject) {
                                 check_request_id(request->request_id());
                                 const JobKey key = job_key_of(who.tenant, request->name());
                                 subject = job_name(key);
                                 *reply = to_proto(registry_.retry(key, request->request_id()));
                             });
}

grpc::ServerUnaryReactor* JobService::DeleteJob(grpc::CallbackServerContext* context,
                                                const v1::DeleteJobRequest* request,
                                                v1::DeleteJobResponse* reply) {
    return reception_.answer(
        {context, request, reply}, kDelete, [=, this](const Principal& who, std::string& subject) {
            const auto revision = request->etag().empty()
                                      ? std::nullopt
                                      : std::optional(revision_of(request->etag()));
            const JobKey key = job_key_of(who.tenant, request->name());
            subject = job_name(key);
            registry_.remove(key, revision);
        });
}

CapabilityService::CapabilityService(Reception& reception, const ServerLimits& limits)
    : reception_(reception) {
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

grpc::ServerUnaryReactor* CapabilityService::GetCapabilities(
    grpc::CallbackServerContext* context, const v1::GetCapabilitiesRequest* request,
    v1::GetCapabilitiesResponse* reply) {
    return reception_.answer({context, request, reply}, kCapabilities,
                             [=, this](const Principal&, std::string&) { *reply = capabilities_; });
}

}  // namespace remesh
