#include "tests/service/client_fake_server.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "client/failure.h"
#include "client/sha256.h"

namespace remesh::client {
namespace {

constexpr std::size_t kChunk = 64 * 1024;

grpc::Status not_found(const std::string& name) {
    return {grpc::StatusCode::NOT_FOUND, "no job " + name};
}

std::string digest_of(const std::string& data) {
    Sha256 sha;
    sha.update(data);
    return sha.finish();
}

v1::Quality quality_with(double edge_length) {
    v1::Quality quality;
    quality.set_edge_length(edge_length);
    quality.mutable_before()->set_triangles(1234);
    quality.mutable_after()->set_triangles(56789);
    quality.mutable_after()->mutable_radius_ratio()->set_mean(0.981);
    quality.mutable_tets()->set_tets(1234567);
    quality.mutable_tets()->mutable_radius_ratio()->set_mean(0.943);
    quality.mutable_output_to_input()->set_p99(0.1 * edge_length);
    auto& defect = *quality.add_defects();
    defect.set_code("OPEN_BOUNDARY");
    defect.set_description("3 holes were closed");
    return quality;
}

}  // namespace

FakeServer::FakeServer(std::string listen) : listen_(std::move(listen)) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort(listen_, grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(static_cast<v1::JobService::Service*>(this));
    builder.RegisterService(static_cast<v1::ArtifactService::Service*>(this));
    builder.RegisterService(static_cast<v1::CapabilityService::Service*>(this));
    server_ = builder.BuildAndStart();
}

FakeServer::~FakeServer() {
    server_->Shutdown(std::chrono::system_clock::now());
}

std::string FakeServer::address() const {
    return listen_.starts_with("unix:") ? listen_ : fmt::format("127.0.0.1:{}", port_);
}

std::string FakeServer::content_of(v1::Format format) {
    std::string content = v1::Format_Name(format) + ":";
    while (content.size() < 3 * kChunk + 17) {
        content += static_cast<char>('a' + content.size() * 7919 % 26);
    }
    return content;
}

std::vector<v1::CreateJobRequest> FakeServer::creates() {
    const std::scoped_lock lock(mutex_);
    return creates_;
}

std::vector<v1::Job> FakeServer::jobs() {
    const std::scoped_lock lock(mutex_);
    std::vector<v1::Job> jobs;
    for (const auto& [name, job] : jobs_) {
        jobs.push_back(job);
    }
    return jobs;
}

std::vector<std::int64_t> FakeServer::watches() {
    const std::scoped_lock lock(mutex_);
    return watches_;
}

std::vector<std::int64_t> FakeServer::downloads() {
    const std::scoped_lock lock(mutex_);
    return downloads_;
}

int FakeServer::uploads_with_bytes() {
    const std::scoped_lock lock(mutex_);
    return uploads_with_bytes_;
}

std::vector<std::string> FakeServer::authorizations() {
    const std::scoped_lock lock(mutex_);
    return authorizations_;
}

void FakeServer::wait_for_watch() {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::minutes(5), [this] { return !watches_.empty(); });
}

v1::Job FakeServer::add_job(v1::Job job) {
    const std::scoped_lock lock(mutex_);
    job.set_name(fmt::format("tenants/default/jobs/{:03}", jobs_.size() + 1));
    job = finished(job);
    jobs_[job.name()] = job;
    return job;
}

v1::Digest FakeServer::store(const std::string& data) {
    v1::Digest digest;
    digest.set_sha256(digest_of(data));
    digest.set_size_bytes(static_cast<std::int64_t>(data.size()));
    artifacts_[digest.sha256()] = data;
    return digest;
}

v1::Job FakeServer::finished(v1::Job job) {
    const std::string& content = artifacts_[job.spec().input().digest().sha256()];
    const bool fails = !failing_content.empty() && content == failing_content;
    job.set_state(fails ? v1::Job::STATE_FAILED : outcome);
    if (job.state() == v1::Job::STATE_FAILED) {
        *job.mutable_failure() = failure;
    }
    if (job.state() != v1::Job::STATE_SUCCEEDED) {
        return job;
    }
    v1::Result& result = *job.mutable_result();
    *result.mutable_quality() =
        quality_with(job.spec().options().has_edge_length() ? job.spec().options().edge_length()
                                                            : chosen_edge_length);
    for (const v1::OutputRequest& request : job.spec().outputs()) {
        v1::Output& output = *result.add_outputs();
        const bool is_tets = request.format() == v1::FORMAT_VTU;
        output.set_kind(is_tets ? v1::Output::KIND_TETRAHEDRA : v1::Output::KIND_SURFACE);
        output.set_format(request.format());
        output.set_file_name(is_tets ? "mesh.vtu" : "mesh.ply");
        *output.mutable_digest() = store(content_of(request.format()));
    }
    v1::Output& report = *result.add_outputs();
    report.set_kind(v1::Output::KIND_REPORT);
    report.set_file_name("report.json");
    *report.mutable_digest() = store("{}");
    return job;
}

grpc::Status FakeServer::CreateJob(grpc::ServerContext* context,
                                   const v1::CreateJobRequest* request, v1::Job* reply) {
    const std::scoped_lock lock(mutex_);
    creates_.push_back(*request);
    const auto& metadata = context->client_metadata();
    if (const auto found = metadata.find("authorization"); found != metadata.end()) {
        authorizations_.emplace_back(found->second.data(), found->second.size());
    }
    const bool fails = !create_errors.empty();
    if (!fails || !keeps_first_created) {
        std::string& name = job_of_request_[request->request_id()];
        if (name.empty()) {
            name = fmt::format("tenants/default/jobs/{:03}", jobs_.size() + 1);
            v1::Job& job = jobs_[name];
            job.set_name(name);
            job.set_state(v1::Job::STATE_QUEUED);
            *job.mutable_spec() = request->spec();
        }
        *reply = jobs_[name];
    }
    if (fails) {
        const grpc::Status error = create_errors.front();
        create_errors.pop_front();
        return error;
    }
    return grpc::Status::OK;
}

grpc::Status FakeServer::GetJob(grpc::ServerContext*, const v1::GetJobRequest* request,
                                v1::Job* reply) {
    const std::scoped_lock lock(mutex_);
    const auto found = jobs_.find(request->name());
    if (found == jobs_.end()) {
        return not_found(request->name());
    }
    *reply = found->second;
    return grpc::Status::OK;
}

grpc::Status FakeServer::ListJobs(grpc::ServerContext*, const v1::ListJobsRequest* request,
                                  v1::ListJobsResponse* reply) {
    const std::scoped_lock lock(mutex_);
    // One job a page, so that a client that ignores the token is found out.
    auto next = request->page_token().empty() ? jobs_.begin() : jobs_.find(request->page_token());
    if (next != jobs_.end()) {
        *reply->add_jobs() = next->second;
        ++next;
    }
    if (next != jobs_.end()) {
        reply->set_next_page_token(next->first);
    }
    return grpc::Status::OK;
}

grpc::Status FakeServer::WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                                  grpc::ServerWriter<v1::JobEvent>* writer) {
    std::unique_lock lock(mutex_);
    const auto found = jobs_.find(request->name());
    if (found == jobs_.end()) {
        return not_found(request->name());
    }
    v1::Job& job = found->second;
    watches_.push_back(request->after_sequence());
    const bool breaks = events_before_break > 0 && watches_.size() == 1;
    changed_.notify_all();

    if (job.state() == v1::Job::STATE_QUEUED) {
        job.set_state(v1::Job::STATE_RUNNING);
    }
    v1::JobEvent event;
    *event.mutable_snapshot() = job;
    writer->Write(event);
    for (int sequence = 1; sequence <= 5; ++sequence) {
        if (breaks && sequence > events_before_break) {
            return break_error;
        }
        if (sequence > request->after_sequence()) {
            event.set_sequence(sequence);
            event.mutable_sample()->set_iteration(sequence);
            writer->Write(event);
        }
    }
    while (outcome == v1::Job::STATE_RUNNING && !is_terminal(job.state()) &&
           !context->IsCancelled()) {
        changed_.wait_for(lock, std::chrono::milliseconds(10));
    }
    if (!is_terminal(job.state())) {
        job = finished(job);
    }
    event.set_sequence(6);
    *event.mutable_completed() = job;
    writer->Write(event);
    return grpc::Status::OK;
}

grpc::Status FakeServer::CancelJob(grpc::ServerContext*, const v1::CancelJobRequest* request,
                                   v1::Job* reply) {
    const std::scoped_lock lock(mutex_);
    const auto found = jobs_.find(request->name());
    if (found == jobs_.end()) {
        return not_found(request->name());
    }
    found->second.set_state(v1::Job::STATE_CANCELLED);
    *reply = found->second;
    changed_.notify_all();
    return grpc::Status::OK;
}

grpc::Status FakeServer::DeleteJob(grpc::ServerContext*, const v1::DeleteJobRequest* request,
                                   v1::DeleteJobResponse*) {
    const std::scoped_lock lock(mutex_);
    return jobs_.erase(request->name()) == 1 ? grpc::Status::OK : not_found(request->name());
}

grpc::Status FakeServer::UploadArtifact(grpc::ServerContext*,
                                        grpc::ServerReader<v1::UploadArtifactRequest>* reader,
                                        v1::UploadArtifactResponse* reply) {
    v1::UploadArtifactRequest chunk;
    std::string data;
    while (reader->Read(&chunk)) {
        if (chunk.has_digest()) {
            *reply->mutable_digest() = chunk.digest();
            const std::scoped_lock lock(mutex_);
            if (artifacts_.contains(chunk.digest().sha256())) {
                reply->set_already_present(true);
                return grpc::Status::OK;
            }
        }
        if (chunk.offset() != static_cast<std::int64_t>(data.size())) {
            return {grpc::StatusCode::INVALID_ARGUMENT, "wrong offset"};
        }
        data += chunk.data();
    }
    if (digest_of(data) != reply->digest().sha256()) {
        return {grpc::StatusCode::INVALID_ARGUMENT, "wrong digest"};
    }
    const std::scoped_lock lock(mutex_);
    ++uploads_with_bytes_;
    store(data);
    return grpc::Status::OK;
}

grpc::Status FakeServer::DownloadArtifact(
    grpc::ServerContext*, const v1::DownloadArtifactRequest* request,
    grpc::ServerWriter<v1::DownloadArtifactResponse>* writer) {
    std::string data;
    bool breaks = false;
    {
        const std::scoped_lock lock(mutex_);
        data = artifacts_[request->sha256()];
        downloads_.push_back(request->offset());
        breaks = bytes_before_break > 0 && downloads_.size() == 1;
    }
    if (corrupts_downloads) {
        data.back() ^= 1;
    }
    for (auto at = static_cast<std::size_t>(request->offset()); at < data.size(); at += kChunk) {
        if (breaks && at >= static_cast<std::size_t>(bytes_before_break)) {
            return {grpc::StatusCode::UNAVAILABLE, "shutting down"};
        }
        v1::DownloadArtifactResponse chunk;
        chunk.set_offset(static_cast<std::int64_t>(at));
        chunk.set_data(data.substr(at, kChunk));
        writer->Write(chunk);
    }
    return grpc::Status::OK;
}

grpc::Status FakeServer::GetCapabilities(grpc::ServerContext*, const v1::GetCapabilitiesRequest*,
                                         v1::GetCapabilitiesResponse* reply) {
    const auto add = [&](v1::Format format, const std::string& extension, bool surface, bool tets) {
        v1::FormatCapability& known = *reply->add_formats();
        known.set_format(format);
        known.set_extension(extension);
        known.set_can_write_surface(surface);
        known.set_can_write_tetrahedra(tets);
    };
    add(v1::FORMAT_PLY, ".ply", true, false);
    add(v1::FORMAT_VTU, ".vtu", false, true);
    add(v1::FORMAT_MSH41, ".msh", false, true);
    add(v1::FORMAT_MSH22, ".msh", false, true);
    add(v1::FORMAT_GIFTI, ".gii", false, false);
    return grpc::Status::OK;
}

}  // namespace remesh::client
