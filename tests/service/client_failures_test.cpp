// The client program when something fails: exit codes, messages, and what it does again.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <tuple>

#include "client/follow.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "tests/service/client_fixture.h"

namespace remesh::client {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::StartsWith;

TEST_F(Client, LeavesAnOldFileAloneWhenTheJobFails) {
    server_.outcome = v1::Job::STATE_FAILED;
    server_.failure = failure_with("INVALID_INPUT", "STL says 4,000,000 triangles but holds 498");
    static_cast<void>(folder_.file("a.vtu", "old"));

    const auto result = remesh({"run", input_, "-o", "a.vtu"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_EQ(result.last_error_line(), "remesh: STL says 4,000,000 triangles but holds 498");
    EXPECT_EQ(content_of(folder_.path() / "a.vtu"), "old");
    EXPECT_THAT(folder_.names(), ElementsAre("a.vtu", "in.stl"));
}

TEST_F(Client, EndsWithFourWhenTheMeshCantBeMade) {
    server_.outcome = v1::Job::STATE_FAILED;
    server_.failure = failure_with("UNMESHABLE", "no mesh within the bounds");

    EXPECT_EQ(remesh({"run", input_}).exit_code, 4);
}

TEST_F(Client, EndsWithFiveWhenSomebodyCancelled) {
    server_.outcome = v1::Job::STATE_CANCELLED;

    EXPECT_EQ(remesh({"run", input_}).exit_code, 5);
}

TEST_F(Client, EndsWithSixWhenNobodyListens) {
    const auto result = run_client(
        folder_, {"--server", "127.0.0.1:1", "--timeout", "0", "run", input_, "-o", "a.ply"});

    EXPECT_EQ(result.exit_code, 6);
    EXPECT_THAT(result.last_error_line(), StartsWith("remesh: can't reach the server"));
}

TEST_F(Client, EndsWithSevenWhenTheQueueIsFull) {
    server_.create_errors = {{grpc::StatusCode::RESOURCE_EXHAUSTED, "the queue is full"}};

    const auto result = remesh({"submit", input_});

    EXPECT_EQ(result.exit_code, 7);
    EXPECT_EQ(result.last_error_line(), "remesh: the queue is full");
}

TEST_F(Client, EndsWithThreeWhenAnOptionIsOutOfRange) {
    server_.create_errors = {
        {grpc::StatusCode::INVALID_ARGUMENT, "relaxation.damping must be in (0, 2], got 7"}};

    const auto result = remesh({"run", input_, "--damping", "7"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_EQ(result.last_error_line(), "remesh: relaxation.damping must be in (0, 2], got 7");
}

grpc::Status status_with(grpc::StatusCode code, const std::string& message,
                         const google::protobuf::Message& detail) {
    google::rpc::Status status;
    status.set_code(code);
    status.set_message(message);
    status.add_details()->PackFrom(detail);
    return {code, message, status.SerializeAsString()};
}

TEST_F(Client, TellsEachFieldThatWasRefused) {
    google::rpc::BadRequest details;
    auto* damping = details.add_field_violations();
    damping->set_field("spec.options.relaxation.damping");
    damping->set_description("relax.damping must be in (0, 2], got 7");
    auto* outputs = details.add_field_violations();
    outputs->set_field("spec.outputs");
    outputs->set_description("at least one is needed");
    server_.create_errors = {
        status_with(grpc::StatusCode::INVALID_ARGUMENT, "two things", details)};

    const auto result = remesh({"run", input_});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.err, HasSubstr("2 fields were refused:\n"
                                      "  spec.options.relaxation.damping must be in (0, 2], got 7\n"
                                      "  spec.outputs: at least one is needed\n"));
}

TEST_F(Client, TellsWhichLimitWasPassed) {
    google::rpc::QuotaFailure details;
    details.add_violations()->set_subject("queue");
    server_.create_errors = {
        status_with(grpc::StatusCode::RESOURCE_EXHAUSTED, "the queue is full", details)};

    EXPECT_EQ(remesh({"submit", input_}).last_error_line(),
              "remesh: the queue is full (limit: queue)");
}

TEST_F(Client, TellsWhichResourceIsMeant) {
    google::rpc::ResourceInfo details;
    details.set_resource_name("abc");
    details.set_description("upload it");
    server_.create_errors = {
        status_with(grpc::StatusCode::FAILED_PRECONDITION, "the input isn't there", details)};

    EXPECT_EQ(remesh({"submit", input_}).last_error_line(),
              "remesh: the input isn't there (abc: upload it)");
}

TEST_F(Client, WaitsAsLongAsABusyServerAsks) {
    google::rpc::RetryInfo details;
    details.mutable_retry_delay()->set_seconds(1);
    server_.create_errors = {status_with(grpc::StatusCode::UNAVAILABLE, "busy", details)};
    const auto start = std::chrono::steady_clock::now();

    const auto result = remesh({"submit", input_});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::seconds(1));
}

grpc::Status too_much_at_a_time() {
    google::rpc::Status status;
    status.set_code(grpc::StatusCode::RESOURCE_EXHAUSTED);
    status.set_message("a tenant has at most 10 bytes of calls at a time");
    google::rpc::QuotaFailure limit;
    limit.add_violations()->set_subject("tenants/default/bytes of calls");
    status.add_details()->PackFrom(limit);
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_nanos(1'000'000);
    status.add_details()->PackFrom(retry);
    return {grpc::StatusCode::RESOURCE_EXHAUSTED, status.message(), status.SerializeAsString()};
}

TEST_F(Client, GoesOnWhenOthersDidTooMuchAtATime) {
    server_.create_errors = {too_much_at_a_time(), too_much_at_a_time()};
    server_.events_before_break = 3;
    server_.break_error = too_much_at_a_time();

    const auto result = remesh({"run", input_, "-o", "a.vtu"});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(server_.creates(), SizeIs(3));
    EXPECT_THAT(server_.watches(), ElementsAre(0, 3));
}

TEST_F(Client, EndsWithSevenWhenOthersDoTooMuchForLongerThanItsPatience) {
    server_.create_errors = {100, too_much_at_a_time()};

    const auto result = remesh({"--timeout", "0.1", "submit", input_});

    EXPECT_EQ(result.exit_code, 7);
    EXPECT_THAT(result.last_error_line(), HasSubstr("bytes of calls at a time"));
    EXPECT_GE(server_.creates().size(), 2U);
}

TEST_F(Client, DoesntWaitForAFullDisk) {
    google::rpc::RetryInfo details;
    details.mutable_retry_delay()->set_seconds(60);
    server_.create_errors = {
        status_with(grpc::StatusCode::RESOURCE_EXHAUSTED, "the server's disk is full", details)};

    EXPECT_EQ(remesh({"submit", input_}).exit_code, 7);
    EXPECT_THAT(server_.creates(), SizeIs(1));
}

TEST_F(Client, EndsWithThreeWhenTheInputCantBeRead) {
    const auto result = remesh({"run", "missing.stl"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_EQ(result.last_error_line(),
              "remesh: can't read missing.stl: No such file or directory");
    EXPECT_THAT(server_.creates(), IsEmpty());
}

TEST_F(Client, MakesOneJobAlthoughTheFirstAnswerWasLost) {
    server_.create_errors = {{grpc::StatusCode::UNAVAILABLE, "connection reset"}};
    server_.keeps_first_created = false;

    const auto result = remesh({"submit", input_});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    ASSERT_THAT(server_.creates(), SizeIs(2));
    EXPECT_EQ(server_.creates()[0].request_id(), server_.creates()[1].request_id());
    EXPECT_THAT(server_.jobs(), SizeIs(1));
}

TEST_F(Client, GoesOnWatchingWhereTheStreamBroke) {
    server_.events_before_break = 3;
    const std::string name = remesh({"submit", input_}).out;

    const auto result = remesh({"watch", name.substr(0, name.size() - 1), "--json"});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    std::vector<int> sequences;
    for (const json& event : json_lines(result.out)) {
        if (event["sequence"] != 0) {
            sequences.push_back(event["sequence"]);
        }
    }
    EXPECT_THAT(sequences, ElementsAre(1, 2, 3, 4, 5, 6));
    EXPECT_THAT(server_.watches(), ElementsAre(0, 3));
    EXPECT_EQ(json_lines(result.out).back()["completed"]["state"], "SUCCEEDED");
}

TEST_F(Client, RenewsAWatchOfAQuietJobThoughItsPatienceIsShort) {
    server_.outcome = v1::Job::STATE_RUNNING;
    v1::Job quiet;
    quiet.set_state(v1::Job::STATE_RUNNING);
    const v1::Job job = server_.add_job(quiet);
    // A watch lasts longer than the patience, but the server has a second to say its first word.
    Connection connection({server_.address(), {}, std::chrono::milliseconds(900), {}}, {});
    const auto cancel_after_some_renewals = [&](const v1::JobEvent&) {
        if (server_.watches().size() == 3) {
            std::ignore = connection.cancel_job(job.name());
        }
    };
    const v1::Job end =
        follow(connection, job.name(), 0, cancel_after_some_renewals, std::chrono::seconds(1));
    EXPECT_EQ(end.state(), v1::Job::STATE_CANCELLED);
    EXPECT_GE(server_.watches().size(), 3U);
}

TEST_F(Client, GoesOnDownloadingWhereTheStreamBroke) {
    server_.bytes_before_break = 65'536;

    const auto result = remesh({"run", input_, "-o", "a.vtu"});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(content_of(folder_.path() / "a.vtu"), FakeServer::content_of(v1::FORMAT_VTU));
    EXPECT_THAT(server_.downloads(), ElementsAre(0, 65'536));
}

TEST_F(Client, WritesNothingWhenBytesDontHaveTheirDigest) {
    server_.corrupts_downloads = true;

    const auto result = remesh({"run", input_, "-o", "a.vtu"});

    EXPECT_EQ(result.exit_code, 4);
    EXPECT_THAT(folder_.names(), ElementsAre("in.stl"));
}

TEST_F(Client, SaysThatAJobIsntThere) {
    const auto result = remesh({"show", "tenants/default/jobs/none"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_EQ(result.last_error_line(), "remesh: no job tenants/default/jobs/none");
}

TEST_F(Client, RunsABatchToItsEndAlthoughOneFileIsBad) {
    server_.failing_content = "bad";
    server_.failure = failure_with("INVALID_INPUT", "not a mesh");
    const std::string bad = folder_.file("bad.stl", "bad");

    const auto result = remesh({"run", bad, input_, "--output-dir", "out"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.err, HasSubstr("bad.stl: not a mesh"));
    EXPECT_THAT(result.out, HasSubstr("SUCCEEDED"));
    EXPECT_TRUE(std::filesystem::exists(folder_.path() / "out/in_remeshed.vtu"));
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out/bad_remeshed.vtu"));
}

}  // namespace
}  // namespace remesh::client
