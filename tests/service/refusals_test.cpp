// What the service refuses, and with which words.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::behind;
using testing::CallContext;
using testing::detail_of;
using ::testing::ElementsAre;
using testing::Gate;
using ::testing::HasSubstr;
using testing::ScriptedEngine;
using testing::TestServer;

const ScriptedEngine kCopy;

TEST(Service, RefusesBadOptionsAllAtOnceWithTheirFields) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = server.request_for("mesh");
    request.mutable_spec()->mutable_options()->set_edge_length(-1.0);
    request.mutable_spec()->mutable_options()->mutable_relaxation()->set_damping(7.0);
    v1::Job job;

    const grpc::Status status = server.create(request, &job);

    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    const auto details = detail_of<google::rpc::BadRequest>(status);
    ASSERT_TRUE(details);
    ASSERT_EQ(details->field_violations_size(), 2);
    EXPECT_EQ(details->field_violations(0).field(), "spec.options.edge_length");
    EXPECT_EQ(details->field_violations(1).field(), "spec.options.relaxation.damping");
    EXPECT_EQ(detail_of<google::rpc::ErrorInfo>(status)->domain(), "remesh");
}

TEST(Service, RefusesASpecOfTheWrongShape) {
    TestServer server(kCopy);
    v1::CreateJobRequest request;
    request.mutable_spec()->set_priority(1'000);
    v1::Job job;

    const grpc::Status status = server.create(request, &job);

    const auto details = detail_of<google::rpc::BadRequest>(status);
    ASSERT_TRUE(details);
    std::vector<std::string> fields;
    for (const auto& violation : details->field_violations()) {
        fields.push_back(violation.field());
    }
    EXPECT_THAT(fields, ElementsAre("spec.input.digest.sha256", "spec.outputs", "spec.priority"));
}

TEST(Service, RefusesTimeLimitsThatArentAny) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = server.request_for("mesh");
    v1::Job job;

    for (const std::int64_t seconds :
         {std::int64_t{0}, std::int64_t{-1}, std::int64_t{31'536'001},
          std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::min()}) {
        request.mutable_spec()->mutable_timeout()->set_seconds(seconds);
        const grpc::Status status = server.create(request, &job);
        EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
        EXPECT_THAT(status.error_message(), HasSubstr("spec.timeout must be in [1, 31536000]"));
    }
    request.mutable_spec()->mutable_timeout()->set_seconds(31'536'000);
    EXPECT_TRUE(server.create(request, &job).ok());
    EXPECT_EQ(server.watch(job.name()).back().completed().state(), v1::Job::STATE_SUCCEEDED);
}

TEST(Service, RefusesASpecThatItCouldntTellAgain) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = server.request_for("mesh");
    auto* regions = request.mutable_spec()->mutable_options()->mutable_sizing()->mutable_regions();
    v1::Job job;

    auto* coordinates = regions->Add()->mutable_points()->mutable_coordinates();
    coordinates->Resize(150'000, 1.0);
    EXPECT_TRUE(server.create(request, &job).ok());
    EXPECT_TRUE(server.get(job.name(), &job).ok());
    coordinates->Resize(200'000, 1.0);

    const grpc::Status status = server.create(request, &job);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_THAT(status.error_message(), HasSubstr("spec must have at most 1.5 MiB, got 1600"));
}

TEST(Service, RefusesStatesThatItDoesntKnowAndTakesTheOthersOnce) {
    TestServer server(kCopy);
    const std::string name = server.create("mesh").name();
    server.wait_for(name, v1::Job::STATE_SUCCEEDED);
    const auto list = [&](const v1::ListJobsRequest& request, v1::ListJobsResponse* page) {
        CallContext context;
        return server.jobs->ListJobs(&context, request, page);
    };
    v1::ListJobsRequest many;
    for (int i = 0; i < 100'000; ++i) {
        many.add_states(v1::Job::STATE_SUCCEEDED);
    }
    v1::ListJobsRequest unknown;
    unknown.add_states(static_cast<v1::Job::State>(77));
    v1::ListJobsResponse page;

    EXPECT_TRUE(list(many, &page).ok());
    EXPECT_EQ(page.jobs_size(), 1);
    EXPECT_EQ(list(unknown, &page).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST(Service, RefusesAJobWhoseInputWasNotUploaded) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = server.request_for("mesh");
    request.mutable_spec()->mutable_input()->mutable_digest()->set_sha256(sha256_of("other"));
    v1::Job job;

    const grpc::Status status = server.create(request, &job);

    EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    const auto details = detail_of<google::rpc::ResourceInfo>(status);
    ASSERT_TRUE(details);
    EXPECT_EQ(details->resource_name(), sha256_of("other"));
}

TEST(Service, SaysWhatATenantMayNotKeep) {
    TestServer server(
        kCopy, [](ServerOptions& options) { options.registry.limits.max_bytes_of_tenant = 8; });
    server.upload("12345");
    v1::Digest digest;
    digest.set_sha256(sha256_of("6789"));
    digest.set_size_bytes(4);
    v1::UploadArtifactResponse response;

    const grpc::Status status = server.upload("6789", digest, &response);

    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    const auto details = detail_of<google::rpc::QuotaFailure>(status);
    ASSERT_TRUE(details);
    EXPECT_EQ(details->violations(0).subject(), "tenants/default/bytes");
}

TEST(Service, SaysWhenTheQueueIsFull) {
    Gate gate;
    const ScriptedEngine engine(behind(gate));
    TestServer server(engine,
                      [](ServerOptions& options) { options.registry.limits.max_queued = 1; });
    server.wait_for(server.create("runs").name(), v1::Job::STATE_RUNNING);
    server.create("waits");
    v1::Job job;

    const grpc::Status status = server.create(server.request_for("too much"), &job);

    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_TRUE(detail_of<google::rpc::QuotaFailure>(status));
    gate.open();
}

TEST(Service, RefusesMalformedNames) {
    TestServer server(kCopy);
    v1::Job job;

    EXPECT_EQ(server.get("jobs/../x", &job).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(server.get("tenants/default/jobs/none", &job).error_code(),
              grpc::StatusCode::NOT_FOUND);
}

TEST(Service, RefusesBytesThatDoNotHaveTheirDigest) {
    TestServer server(kCopy);
    v1::Digest digest;
    digest.set_sha256(sha256_of("hello"));
    digest.set_size_bytes(5);
    v1::UploadArtifactResponse response;

    const grpc::Status status = server.upload("hullo", digest, &response);
    std::string bytes;

    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_THAT(status.error_message(), HasSubstr(sha256_of("hullo")));
    EXPECT_EQ(server.download(sha256_of("hello"), 0, 0, &bytes).error_code(),
              grpc::StatusCode::NOT_FOUND);
    EXPECT_EQ(server.download(sha256_of("hullo"), 0, 0, &bytes).error_code(),
              grpc::StatusCode::NOT_FOUND);
}

TEST(Service, RefusesArtifactsThatAreTooLarge) {
    TestServer server(kCopy, [](ServerOptions& options) { options.max_artifact_bytes = 4; });
    v1::Digest digest;
    digest.set_sha256(sha256_of("hello"));
    digest.set_size_bytes(5);
    v1::UploadArtifactResponse response;

    EXPECT_EQ(server.upload("hello", digest, &response).error_code(),
              grpc::StatusCode::RESOURCE_EXHAUSTED);
}

/// A download that somebody began and doesn't go on with: more is to come than can be on its way.
class HeldDownload {
public:
    HeldDownload(TestServer& server, const std::string& sha256) : context_(server.token) {
        v1::DownloadArtifactRequest request;
        request.set_sha256(sha256);
        stream_ = server.artifacts->DownloadArtifact(&context_, request);
        has_begun_ = stream_->Read(&chunk_);
    }
    [[nodiscard]] bool has_begun() const { return has_begun_; }
    grpc::Status finish() {
        while (stream_->Read(&chunk_)) {
        }
        return stream_->Finish();
    }

private:
    CallContext context_;
    std::unique_ptr<grpc::ClientReader<v1::DownloadArtifactResponse>> stream_;
    v1::DownloadArtifactResponse chunk_;
    bool has_begun_;
};

TEST(Service, LimitsTheTransfersOfATenantAtATime) {
    TestServer server(kCopy, [](ServerOptions& options) {
        options.requires_credentials = true;
        options.transfers.max_transfers_of_tenant = 2;
    });
    const std::string clinic = server.token_for("clinic");
    const std::string lab = server.token_for("lab");
    server.token = clinic;
    const std::string sha256 = server.upload(std::string(std::size_t{64} << 20U, 'x')).sha256();
    HeldDownload first(server, sha256);
    HeldDownload second(server, sha256);
    ASSERT_TRUE(first.has_begun() && second.has_begun());
    const auto upload = [&](const std::string& token) {
        server.token = token;
        v1::Digest digest;
        digest.set_sha256(sha256_of("hello"));
        digest.set_size_bytes(5);
        v1::UploadArtifactResponse response;
        return server.upload("hello", digest, &response);
    };

    HeldDownload third(server, sha256);
    const grpc::Status refused = upload(clinic);
    EXPECT_EQ(third.finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_EQ(refused.error_message(), "a tenant has at most 2 transfers at a time");
    const auto details = detail_of<google::rpc::QuotaFailure>(refused);
    ASSERT_TRUE(details);
    EXPECT_EQ(details->violations(0).subject(), "tenants/clinic/transfers");
    EXPECT_TRUE(upload(lab).ok()) << "it has its own";

    EXPECT_TRUE(first.finish().ok());
    EXPECT_TRUE(upload(clinic).ok());
    EXPECT_TRUE(second.finish().ok());
}

TEST(Service, LimitsTheNumberOfWatches) {
    TestServer server(kCopy, [](ServerOptions& options) { options.watches.max_watches = 0; });
    grpc::Status status;

    server.watch(server.create("mesh").name(), 0, &status);

    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

}  // namespace
}  // namespace remesh
