#include "client/create_job.h"

#include <fmt/format.h>
#include <sys/random.h>

#include <array>
#include <utility>

#include "client/failure.h"

namespace remesh::client {
namespace {

std::string random_id() {
    std::array<unsigned char, 16> bytes{};
    if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
        throw system_failure("can't make a request id");
    }
    return fmt::format("{:02x}", fmt::join(bytes, ""));
}

v1::CreateJobRequest request_for(Connection& connection, const JobFiles& files, v1::JobSpec spec) {
    upload(connection, files.surface);
    *spec.mutable_input()->mutable_digest() = files.surface.digest();
    spec.mutable_input()->set_file_name(files.surface.name());
    if (files.size_image != nullptr) {
        upload(connection, *files.size_image);
        *spec.mutable_size_image()->mutable_digest() = files.size_image->digest();
    }
    v1::CreateJobRequest request;
    *request.mutable_spec() = std::move(spec);
    return request;
}

}  // namespace

v1::Job create_job(Connection& connection, const JobFiles& files, v1::JobSpec spec) {
    v1::CreateJobRequest request = request_for(connection, files, std::move(spec));
    request.set_request_id(random_id());
    return connection.create_job(request);
}

v1::Job estimate_job(Connection& connection, const JobFiles& files, v1::JobSpec spec) {
    v1::CreateJobRequest request = request_for(connection, files, std::move(spec));
    request.set_validate_only(true);
    return connection.create_job(request);
}

v1::Job retry_job(Connection& connection, const std::string& name) {
    v1::RetryJobRequest request;
    request.set_name(name);
    request.set_request_id(random_id());
    return connection.retry_job(request);
}

}  // namespace remesh::client
