// Artifacts: uploads that break and go on, what is missing, what a file holds.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>
#include <vector>

#include "server/partial_uploads.h"
#include "tests/support/full_disk.h"
#include "tests/support/shapes.h"
#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::CallContext;
using testing::detail_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::ScriptedEngine;
using testing::TestServer;

const ScriptedEngine kCopy;

v1::Digest digest_of(const std::string& bytes) {
    v1::Digest digest;
    digest.set_sha256(sha256_of(bytes));
    digest.set_size_bytes(static_cast<std::int64_t>(bytes.size()));
    return digest;
}

/// Bytes without a period, so that none can stand for others.
std::string some_bytes(std::size_t size) {
    std::string bytes(size, '\0');
    for (std::size_t i = 0; i < size; ++i) {
        bytes[i] = static_cast<char>(i * 7 + i / 251);
    }
    return bytes;
}

std::string stl_of(const SurfaceMesh& mesh) {
    std::ostringstream out;
    write_surface(mesh, MeshFormat::Stl, out);
    return out.str();
}

class Artifacts : public ::testing::Test {
protected:
    Artifacts() : server_(kCopy) {}

    /// Sends one chunk of an artifact and leaves, as if the line broke.
    grpc::Status break_after(const std::string& bytes, std::size_t sent) {
        v1::UploadArtifactResponse response;
        CallContext context;
        const auto stream = server_.artifacts->UploadArtifact(&context, &response);
        v1::UploadArtifactRequest chunk;
        *chunk.mutable_digest() = digest_of(bytes);
        chunk.set_data(bytes.substr(0, sent));
        stream->Write(chunk);
        stream->WritesDone();
        return stream->Finish();
    }
    v1::Upload upload_of(const std::string& bytes) {
        CallContext context;
        v1::GetUploadRequest request;
        *request.mutable_digest() = digest_of(bytes);
        v1::Upload upload;
        EXPECT_TRUE(server_.artifacts->GetUpload(&context, request, &upload).ok());
        return upload;
    }
    grpc::Status send_from(const std::string& bytes, std::size_t offset) {
        v1::UploadArtifactResponse response;
        CallContext context;
        const auto stream = server_.artifacts->UploadArtifact(&context, &response);
        v1::UploadArtifactRequest chunk;
        *chunk.mutable_digest() = digest_of(bytes);
        chunk.set_offset(static_cast<std::int64_t>(offset));
        chunk.set_data(bytes.substr(offset));
        stream->Write(chunk);
        stream->WritesDone();
        return stream->Finish();
    }
    grpc::Status inspect(const std::string& bytes, const std::string& name,
                         v1::Inspection* inspection) {
        CallContext context;
        v1::InspectArtifactRequest request;
        request.set_sha256(server_.upload(bytes).sha256());
        request.set_file_name(name);
        return server_.artifacts->InspectArtifact(&context, request, inspection);
    }
    std::vector<std::string> missing(const std::string& bytes) {
        CallContext context;
        v1::FindMissingArtifactsRequest request;
        *request.add_digests() = digest_of(bytes);
        v1::FindMissingArtifactsResponse response;
        EXPECT_TRUE(server_.artifacts->FindMissingArtifacts(&context, request, &response).ok());
        std::vector<std::string> digests;
        for (const v1::Digest& digest : response.missing()) {
            digests.push_back(digest.sha256());
        }
        return digests;
    }
    std::filesystem::path artifact_file(const std::string& bytes) const {
        return server_.data_dir() / "tenants/default/artifacts" / sha256_of(bytes);
    }

    TestServer server_;
};

TEST_F(Artifacts, GoOnWhereAnUploadBroke) {
    const std::string bytes = some_bytes(1'000'000);

    EXPECT_EQ(break_after(bytes, 300'000).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(upload_of(bytes).committed_bytes(), 300'000);
    EXPECT_TRUE(send_from(bytes, 300'000).ok());

    std::string all;
    EXPECT_TRUE(server_.download(sha256_of(bytes), 0, 0, &all).ok());
    EXPECT_EQ(all, bytes);
    EXPECT_TRUE(upload_of(bytes).is_complete());
}

TEST_F(Artifacts, ThatWereDamagedAreMissingOnceThatIsNoticedAndCanComeAgain) {
    const std::string bytes = some_bytes(3'000'000);
    std::string damaged = bytes;
    damaged[2'500'000] = static_cast<char>(~damaged[2'500'000]);
    server_.upload(bytes);
    std::ofstream(artifact_file(bytes)) << damaged;
    std::string got;

    EXPECT_TRUE(missing(bytes).empty()) << "only reading it tells";
    const grpc::Status lost = server_.download(sha256_of(bytes), 0, 0, &got);
    EXPECT_EQ(lost.error_code(), grpc::StatusCode::DATA_LOSS);
    EXPECT_EQ(detail_of<google::rpc::ErrorInfo>(lost)->reason(), "ARTIFACT_DAMAGED");
    EXPECT_THAT(missing(bytes), ElementsAre(sha256_of(bytes)));
    EXPECT_FALSE(upload_of(bytes).is_complete());
    EXPECT_EQ(server_.download(sha256_of(bytes), 0, 0, &got).error_code(),
              grpc::StatusCode::DATA_LOSS);

    v1::UploadArtifactResponse response;
    EXPECT_TRUE(server_.upload(bytes, digest_of(bytes), &response).ok());
    EXPECT_FALSE(response.already_present());
    EXPECT_TRUE(missing(bytes).empty());
    got.clear();
    EXPECT_TRUE(server_.download(sha256_of(bytes), 0, 0, &got).ok());
    EXPECT_EQ(got, bytes);
}

TEST_F(Artifacts, ArentSentForAnEnormousRequest) {
    v1::DownloadArtifactRequest request;
    request.set_sha256(std::string(100'000, '0'));
    v1::DownloadArtifactResponse chunk;
    CallContext context(server_.token);
    const auto stream = server_.artifacts->DownloadArtifact(&context, request);
    EXPECT_FALSE(stream->Read(&chunk));
    const grpc::Status status = stream->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_THAT(status.error_message(), HasSubstr("request must take at most 65536 bytes"));
}

TEST_F(Artifacts, WhoseFileIsGoneOrShortAreMissing) {
    const v1::CreateJobRequest request = server_.request_for("mesh");
    v1::Job job;
    for (const auto& damage :
         {std::function([](const std::filesystem::path& file) { std::filesystem::remove(file); }),
          std::function(
              [](const std::filesystem::path& file) { std::filesystem::resize_file(file, 3); })}) {
        damage(artifact_file("mesh"));

        EXPECT_THAT(missing("mesh"), ElementsAre(sha256_of("mesh")));
        EXPECT_EQ(server_.create(request, &job).error_code(),
                  grpc::StatusCode::FAILED_PRECONDITION);
        server_.upload("mesh");
        ASSERT_TRUE(server_.create(request, &job).ok());
        EXPECT_EQ(server_.watch(job.name()).back().completed().state(), v1::Job::STATE_SUCCEEDED);
    }
}

TEST_F(Artifacts, ThatAreGoneDontHideTheJobOfARepeatedRequest) {
    v1::CreateJobRequest request = server_.request_for("mesh");
    request.set_request_id("r");
    v1::Job first;
    ASSERT_TRUE(server_.create(request, &first).ok());
    std::filesystem::remove(artifact_file("mesh"));

    v1::Job again;
    EXPECT_TRUE(server_.create(request, &again).ok());
    EXPECT_EQ(again.name(), first.name());
    request.set_request_id("s");
    EXPECT_EQ(server_.create(request, &again).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
}

TEST_F(Artifacts, CanBeMendedByATenantWhoMayKeepNoMore) {
    TestServer server(
        kCopy, [](ServerOptions& options) { options.registry.limits.max_bytes_of_tenant = 5; });
    server.upload("bytes");
    std::filesystem::remove(server.data_dir() / "tenants/default/artifacts" / sha256_of("bytes"));

    server.upload("bytes");

    std::string got;
    EXPECT_TRUE(server.download(sha256_of("bytes"), 0, 0, &got).ok());
}

TEST_F(Artifacts, AreMendedForTheirOwnTenantAlone) {
    TestServer server(kCopy, [](ServerOptions& options) { options.requires_credentials = true; });
    const std::string clinic = server.token_for("clinic");
    const std::string lab = server.token_for("lab");
    for (const std::string& token : {clinic, lab}) {
        server.token = token;
        server.upload("bytes");
    }
    const auto file_of = [&](const std::string& tenant) {
        return server.data_dir() / "tenants" / tenant / "artifacts" / sha256_of("bytes");
    };
    std::ofstream(file_of("clinic")) << "bites";
    const auto written = std::filesystem::last_write_time(file_of("lab"));
    std::string got;
    v1::UploadArtifactResponse response;

    EXPECT_TRUE(server.download(sha256_of("bytes"), 0, 0, &got).ok());
    EXPECT_TRUE(server.upload("bytes", digest_of("bytes"), &response).ok());
    EXPECT_TRUE(response.already_present());
    server.token = clinic;
    EXPECT_EQ(server.download(sha256_of("bytes"), 0, 0, &got).error_code(),
              grpc::StatusCode::DATA_LOSS);
    EXPECT_TRUE(server.upload("bytes", digest_of("bytes"), &response).ok());
    EXPECT_FALSE(response.already_present());
    EXPECT_EQ(std::filesystem::last_write_time(file_of("lab")), written);
}

TEST_F(Artifacts, CountTowardsTheQuotaFromTheirFirstByte) {
    TestServer server(kCopy, [](ServerOptions& options) {
        options.registry.limits.max_bytes_of_tenant = 1'000'000;
    });
    const std::string half = some_bytes(700'000);
    v1::UploadArtifactResponse response;
    {
        CallContext context;
        const auto stream = server.artifacts->UploadArtifact(&context, &response);
        v1::UploadArtifactRequest chunk;
        *chunk.mutable_digest() = digest_of(half);
        chunk.set_data(half.substr(0, 600'000));
        stream->Write(chunk);
        stream->WritesDone();
        stream->Finish();
    }

    const std::string other = some_bytes(500'000) + "other";
    const grpc::Status refused = server.upload(other, digest_of(other), &response);
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    const std::string small = some_bytes(200'000) + "small";
    EXPECT_TRUE(server.upload(small, digest_of(small), &response).ok());
    EXPECT_TRUE(server.upload(half, digest_of(half), &response).ok()) << "its own bytes count once";
}

TEST_F(Artifacts, GoOnAfterTheServerWasRestarted) {
    const std::string bytes = some_bytes(1'000'000);
    break_after(bytes, 300'000);

    server_.stop();
    server_.start();

    EXPECT_EQ(upload_of(bytes).committed_bytes(), 300'000);
    EXPECT_TRUE(send_from(bytes, 300'000).ok());
}

TEST_F(Artifacts, StartAnewFromZeroWhateverCameBefore) {
    const std::string bytes = some_bytes(1'000'000);
    break_after(bytes, 300'000);

    EXPECT_TRUE(send_from(bytes, 0).ok());
}

TEST_F(Artifacts, RefuseToGoOnElsewhere) {
    const std::string bytes = some_bytes(1'000'000);
    break_after(bytes, 300'000);

    EXPECT_EQ(send_from(bytes, 200'000).error_code(), grpc::StatusCode::OUT_OF_RANGE);
    EXPECT_EQ(send_from(bytes, 400'000).error_code(), grpc::StatusCode::OUT_OF_RANGE);
    EXPECT_EQ(upload_of(bytes).committed_bytes(), 300'000);
}

TEST_F(Artifacts, ForgetBytesThatDontHaveTheDigest) {
    const std::string bytes = some_bytes(1'000);
    std::string wrong = bytes;
    wrong[500] ^= 1;
    v1::UploadArtifactResponse response;

    EXPECT_EQ(server_.upload(wrong, digest_of(bytes), &response).error_code(),
              grpc::StatusCode::INVALID_ARGUMENT);

    EXPECT_EQ(upload_of(bytes).committed_bytes(), 0);
}

TEST_F(Artifacts, LetTwoSendTheSameBytesAtATime) {
    const std::string bytes = some_bytes(1'000);
    v1::UploadArtifactResponse response;
    CallContext context;
    const auto first = server_.artifacts->UploadArtifact(&context, &response);
    v1::UploadArtifactRequest chunk;
    *chunk.mutable_digest() = digest_of(bytes);
    chunk.set_data(bytes.substr(0, 10));
    first->Write(chunk);

    EXPECT_TRUE(send_from(bytes, 0).ok());

    chunk.clear_digest();
    chunk.set_offset(10);
    chunk.set_data(bytes.substr(10));
    first->Write(chunk);
    first->WritesDone();
    EXPECT_TRUE(first->Finish().ok());
    std::string all;
    EXPECT_TRUE(server_.download(sha256_of(bytes), 0, 0, &all).ok());
    EXPECT_EQ(all, bytes);
}

TEST(PartialUploads, LeaveNothingOnADiskThatIsFull) {
    const testing::TemporaryDirectory directory;
    PartialUploads uploads(directory.path());
    {
        auto upload = uploads.open("clinic", {sha256_of("mesh"), 5'000}, 0);
        upload->write(std::string(1'000, 'x'));
        EXPECT_EQ(uploads.count("clinic"), 1);
        const testing::FullDisk full(2'000);

        EXPECT_THROW(upload->write(std::string(4'000, 'x')), StoreError);
    }
    EXPECT_EQ(uploads.count("clinic"), 0);
}

TEST(PartialUploads, ArentBegunWhereTheDiskHasNoRoom) {
    const testing::TemporaryDirectory directory;
    const PartialUploads uploads(directory.path());

    EXPECT_NO_THROW(uploads.require_disk(1));
    try {
        uploads.require_disk(std::numeric_limits<std::int64_t>::max());
        FAIL();
    } catch (const StoreError& error) {
        EXPECT_EQ(error.kind(), StoreError::Kind::Full);
    }
}

TEST_F(Artifacts, AreTakenWithoutABit) {
    EXPECT_TRUE(send_from("", 0).ok());
    std::string all = "x";
    all.clear();
    EXPECT_TRUE(server_.download(sha256_of(""), 0, 0, &all).ok());
    EXPECT_EQ(all, "");
}

TEST_F(Artifacts, TellWhichAreMissing) {
    server_.upload("here");
    CallContext context;
    v1::FindMissingArtifactsRequest request;
    *request.add_digests() = digest_of("not here");
    *request.add_digests() = digest_of("here");
    *request.add_digests() = digest_of("nor here");
    v1::FindMissingArtifactsResponse response;

    ASSERT_TRUE(server_.artifacts->FindMissingArtifacts(&context, request, &response).ok());

    ASSERT_EQ(response.missing_size(), 2);
    EXPECT_EQ(response.missing(0).sha256(), sha256_of("not here"));
    EXPECT_EQ(response.missing(1).sha256(), sha256_of("nor here"));
}

TEST_F(Artifacts, SayDataLossWhenTheDiskChangedAByte) {
    const std::string bytes = some_bytes(3'000'000);
    server_.upload(bytes);
    {
        std::fstream file(artifact_file(bytes), std::ios::in | std::ios::out | std::ios::binary);
        file.seekp(2'000'000);
        file.put('!');
    }
    std::string all;

    EXPECT_EQ(server_.download(sha256_of(bytes), 0, 0, &all).error_code(),
              grpc::StatusCode::DATA_LOSS);
}

TEST_F(Artifacts, AreInspected) {
    v1::Inspection inspection;

    const grpc::Status status = inspect(stl_of(testing::unit_cube()), "cube.stl", &inspection);

    ASSERT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(inspection.format(), v1::FORMAT_STL);
    EXPECT_EQ(inspection.triangles(), 12);
    EXPECT_EQ(inspection.vertices(), 8);
    EXPECT_EQ(inspection.components(), 1);
    EXPECT_EQ(inspection.boundary_loops(), 0);
    EXPECT_DOUBLE_EQ(inspection.area(), 6.0);
    EXPECT_THAT(inspection.box_max(), ElementsAre(1.0, 1.0, 1.0));
    EXPECT_GT(inspection.suggested_edge_length(), 0.0);
}

TEST_F(Artifacts, AreInspectedWithTheirHoles) {
    SurfaceMesh open = testing::unit_cube();
    open.triangles.pop_back();
    v1::Inspection inspection;

    ASSERT_TRUE(inspect(stl_of(open), "", &inspection).ok());

    EXPECT_EQ(inspection.boundary_loops(), 1);
    EXPECT_EQ(inspection.boundary_edges(), 3);
}

TEST_F(Artifacts, ThatAreNoSurfacesAreRefusedWithTheReason) {
    v1::Inspection inspection;

    const grpc::Status status = inspect("OFF\n3 7 0\n0 0 0\n", "a.off", &inspection);

    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_THAT(status.error_message(), HasSubstr("OFF"));
}

}  // namespace
}  // namespace remesh
