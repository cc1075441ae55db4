// Jobs with an image of sizes beside their surface.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::detail_of;
using testing::Gate;
using ::testing::HasSubstr;
using testing::ScriptedEngine;
using testing::TestServer;

const ScriptedEngine kCopy;

v1::CreateJobRequest request_with_image(TestServer& server, const std::string& image) {
    v1::CreateJobRequest request = server.request_for("mesh");
    server.upload(image);
    request.mutable_spec()->mutable_size_image()->mutable_digest()->set_sha256(sha256_of(image));
    return request;
}

TEST(Service, GivesAJobItsSizeImage) {
    TestServer server(kCopy);
    v1::Job created;

    const auto status = server.create(request_with_image(server, "image"), &created);
    const v1::Job job = server.watch(created.name()).back().completed();
    std::string bytes;
    server.download(job.result().outputs(0).digest().sha256(), 0, 0, &bytes);

    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(bytes, "out:meshimage");
    EXPECT_EQ(job.spec().size_image().digest().size_bytes(), 5);
    EXPECT_EQ(job.result().provenance().size_image().sha256(), sha256_of("image"));
}

TEST(Service, AnswersAJobWithAnotherSizeImageByNoOldResult) {
    TestServer server(kCopy);
    v1::Job first;
    server.create(request_with_image(server, "image"), &first);
    server.watch(first.name());
    v1::Job again;
    v1::Job other;
    v1::Job none;

    server.create(request_with_image(server, "image"), &again);
    server.create(request_with_image(server, "other image"), &other);
    server.create(server.request_for("mesh"), &none);

    EXPECT_EQ(again.origin(), first.name());
    EXPECT_EQ(other.origin(), "");
    EXPECT_EQ(none.origin(), "");
}

TEST(Service, RefusesAJobWhoseSizeImageIsNotThereOrMalformed) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = request_with_image(server, "image");
    v1::Digest& digest = *request.mutable_spec()->mutable_size_image()->mutable_digest();
    v1::Job job;

    digest.set_sha256(sha256_of("other"));
    const grpc::Status missing = server.create(request, &job);
    request.set_validate_only(true);
    const grpc::Status missing_in_check = server.create(request, &job);
    digest.set_sha256("42");
    request.mutable_spec()->mutable_size_image()->set_format(static_cast<v1::ImageFormat>(9));
    const grpc::Status malformed = server.create(request, &job);

    for (const grpc::Status& status : {missing, missing_in_check}) {
        EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
        const auto details = detail_of<google::rpc::ResourceInfo>(status);
        ASSERT_TRUE(details);
        EXPECT_EQ(details->resource_name(), sha256_of("other"));
    }
    EXPECT_EQ(malformed.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_THAT(malformed.error_message(), HasSubstr("spec.size_image.digest.sha256"));
    EXPECT_THAT(malformed.error_message(), HasSubstr("spec.size_image.format"));
}

TEST(Service, EstimatesAJobWithItsSizeImage) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = request_with_image(server, "image");
    request.set_validate_only(true);
    v1::Job job;

    const grpc::Status status = server.create(request, &job);

    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(job.estimate().tets(), 9);
}

TEST(Service, KeepsTheSizeImageOfAJobThatWaits) {
    Gate gate;
    const ScriptedEngine engine(testing::behind(gate));
    TestServer server(engine);
    v1::Job running;
    server.create(server.request_for("first"), &running);
    gate.wait_for_a_run();
    v1::Job cancelled;
    v1::Job waiting;
    server.create(request_with_image(server, "image"), &cancelled);
    server.create(request_with_image(server, "image"), &waiting);

    server.cancel(cancelled.name(), &cancelled);
    const grpc::Status removal = server.remove(cancelled.name());
    gate.open();
    const v1::Job done = server.watch(waiting.name()).back().completed();
    std::string bytes;
    const grpc::Status kept = server.download(sha256_of("image"), 0, 0, &bytes);
    const grpc::Status last_removal = server.remove(waiting.name());
    const grpc::Status gone = server.download(sha256_of("image"), 0, 0, &bytes);

    EXPECT_TRUE(removal.ok()) << removal.error_message();
    EXPECT_EQ(done.state(), v1::Job::STATE_SUCCEEDED);
    EXPECT_TRUE(kept.ok()) << kept.error_message();
    EXPECT_EQ(bytes, "image");
    EXPECT_TRUE(last_removal.ok()) << last_removal.error_message();
    EXPECT_EQ(gone.error_code(), grpc::StatusCode::NOT_FOUND);
}

}  // namespace
}  // namespace remesh
