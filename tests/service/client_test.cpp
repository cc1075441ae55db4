// The client program against a scripted server, over a real channel.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/syscall.h>

#include <chrono>
#include <memory>
#include <poll.h>
#include <signal.h>
#include <sstream>
#include <tuple>
#include <unistd.h>

#include "client/follow.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "tests/service/client_fake_server.h"
#include "tests/service/client_process.h"

namespace remesh::client {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

std::vector<json> json_lines(const std::string& text) {
    std::vector<json> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) {
        lines.push_back(json::parse(line));
    }
    return lines;
}

v1::Failure failure_with(const std::string& reason, const std::string& message) {
    v1::Failure failure;
    failure.set_reason(reason);
    failure.set_message(message);
    return failure;
}

/// A scripted server, and a folder that holds one input.
class Client : public testing::Test {
protected:
    ClientResult remesh(std::vector<std::string> arguments, const std::string& input = {}) {
        arguments.insert(arguments.begin(), {"--server", server_.address()});
        return run_client(folder_, arguments, {.input = input});
    }

    FakeServer server_;
    TemporaryFolder folder_;
    std::string input_ = folder_.file("in.stl", "solid in");
};

TEST_F(Client, WritesTheTetsAndTheSurfaceOfOneJob) {
    const auto result =
        remesh({"run", input_, "--edge-length", "2.5", "-o", "a.vtu", "-o", "b.ply"});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(content_of(folder_.path() / "a.vtu"), FakeServer::content_of(v1::FORMAT_VTU));
    EXPECT_EQ(content_of(folder_.path() / "b.ply"), FakeServer::content_of(v1::FORMAT_PLY));
    EXPECT_THAT(folder_.names(), ElementsAre("a.vtu", "b.ply", "in.stl"));
    EXPECT_THAT(server_.jobs(), SizeIs(1));
    EXPECT_EQ(server_.creates().at(0).spec().options().edge_length(), 2.5);
}

TEST_F(Client, PrintsWhatTheMeshWasAndWhatItIs) {
    const auto result = remesh({"run", input_, "--edge-length", "2.5"});

    EXPECT_THAT(result.out, HasSubstr("1,234"));
    EXPECT_THAT(result.out, HasSubstr("56,789"));
    EXPECT_THAT(result.out, HasSubstr("0.943"));
    EXPECT_THAT(result.out, HasSubstr("p99 0.100 h"));
    EXPECT_THAT(result.out, HasSubstr("3 holes were closed"));
    EXPECT_THAT(result.out, HasSubstr("in_remeshed.vtu"));
    EXPECT_THAT(result.err, IsEmpty());
}

TEST_F(Client, TellsTheEdgeLengthThatTheServerChose) {
    const auto result = remesh({"run", input_});

    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.out, HasSubstr("edge length h = 1.25 (chosen by the server)"));
    EXPECT_FALSE(server_.creates().at(0).spec().options().has_edge_length());
}

TEST_F(Client, LeavesOptionsThatWerentGivenToTheServer) {
    remesh({"run", input_, "--no-close-holes", "--force", "charged", "--label", "case=7"});

    const v1::JobSpec spec = server_.creates().at(0).spec();
    EXPECT_FALSE(spec.options().prepare().close_holes());
    EXPECT_TRUE(spec.options().prepare().has_close_holes());
    EXPECT_FALSE(spec.options().prepare().has_keep_cavities());
    EXPECT_EQ(spec.options().relaxation().force(), v1::Relaxation::FORCE_CHARGED_PARTICLES);
    EXPECT_FALSE(spec.options().relaxation().has_damping());
    EXPECT_FALSE(spec.options().has_seed());
    EXPECT_EQ(spec.labels().at("case"), "7");
}

TEST_F(Client, AsksForNoTetsWhenOnlyTheSurfaceIsWanted) {
    remesh({"run", input_, "--surface-only"});

    const v1::JobSpec spec = server_.creates().at(0).spec();
    EXPECT_FALSE(spec.options().tetrahedra());
    ASSERT_EQ(spec.outputs_size(), 1);
    EXPECT_EQ(spec.outputs(0).format(), v1::FORMAT_PLY);
}

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

TEST_F(Client, TakesGlobalOptionsFromAFile) {
    const std::string config =
        folder_.file("config.toml", "server = \"" + server_.address() + "\"\njson = true\n");
    server_.add_job({});

    const auto result = run_client(folder_, {"--config", config, "list"});

    EXPECT_THAT(json_lines(result.out), SizeIs(1)) << result.err;
}

TEST_F(Client, TakesTheEnvironmentBeforeAFileAndFlagsBeforeBoth) {
    std::filesystem::create_directories(folder_.path() / "remesh");
    static_cast<void>(folder_.file("remesh/config.toml", "server = \"127.0.0.1:1\"\n"));
    const std::string home = "XDG_CONFIG_HOME=" + folder_.path().string();

    const auto by_environment = run_client(
        folder_, {"list"}, {.environment = {home, "REMESH_SERVER=" + server_.address()}});
    const auto by_flag = run_client(folder_, {"--server", server_.address(), "list"},
                                    {.environment = {home, "REMESH_SERVER=127.0.0.1:2"}});
    const auto by_file = run_client(folder_, {"--timeout", "0", "list"}, {.environment = {home}});

    EXPECT_EQ(by_environment.exit_code, 0) << by_environment.err;
    EXPECT_EQ(by_flag.exit_code, 0) << by_flag.err;
    EXPECT_THAT(by_file.last_error_line(), HasSubstr("127.0.0.1:1"));
}

TEST_F(Client, RefusesAFileWithAnUnknownOption) {
    const std::string config = folder_.file("config.toml", "sever = \"x:1\"\n");

    const auto result = run_client(folder_, {"--config", config, "list"});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, HasSubstr("sever"));
}

TEST_F(Client, ShowsItsTokenToTheServer) {
    const std::string token = folder_.file("token", "remesh_abc\n");

    remesh({"--token-file", token, "submit", input_});
    run_client(folder_, {"--server", server_.address(), "submit", input_},
               {.environment = {"REMESH_TOKEN=remesh_def"}});
    run_client(folder_, {"--server", server_.address(), "--token-file", token, "submit", input_},
               {.environment = {"REMESH_TOKEN=remesh_def"}});

    EXPECT_THAT(server_.authorizations(),
                ElementsAre("Bearer remesh_abc", "Bearer remesh_def", "Bearer remesh_abc"));
}

TEST_F(Client, SendsNoTokenToAnotherMachineInTheClear) {
    const auto result = run_client(folder_, {"--server", "meshes.example:50051", "list"},
                                   {.environment = {"REMESH_TOKEN=remesh_abc"}});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.last_error_line(), HasSubstr("without TLS"));
}

TEST_F(Client, CompletesCommandsAndOptionsInBash) {
    const auto script = run_client(folder_, {"completion", "bash"});
    const std::string file = folder_.file("completion", script.out);
    const auto complete = [&](const std::string& words, int current) {
        return run_client(folder_,
                          {"-c", "source " + file + "; COMP_WORDS=(" + words + "); COMP_CWORD=" +
                                     std::to_string(current) + "; _remesh; echo ${COMPREPLY[@]}"},
                          {.program = "/bin/bash"})
            .out;
    };

    EXPECT_EQ(complete("remesh wa", 1), "watch\n");
    EXPECT_EQ(complete("remesh run --edge", 2), "--edge-length\n");
    EXPECT_EQ(complete("remesh run --smoothing o", 3), "off on\n");
    EXPECT_EQ(complete("remesh --server x:1 run in", 4), "in.stl\n");
}

TEST_F(Client, EndsWithThreeWhenTheInputCantBeRead) {
    const auto result = remesh({"run", "missing.stl"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_EQ(result.last_error_line(),
              "remesh: can't read missing.stl: No such file or directory");
    EXPECT_THAT(server_.creates(), IsEmpty());
}

TEST_F(Client, RefusesToOverwriteItsInput) {
    const std::string input = folder_.file("in.ply", "ply");

    const auto result = remesh({"run", input, "-o", "./in.ply"});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(content_of(input), "ply");
    EXPECT_THAT(server_.creates(), IsEmpty());
}

TEST_F(Client, RefusesAFileOfUnknownFormatBeforeAnyWork) {
    const auto result = remesh({"run", input_, "-o", "a.xyz"});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.last_error_line(), HasSubstr(".ply .vtu .msh"));
    EXPECT_THAT(result.last_error_line(), Not(HasSubstr(".gii")));
    EXPECT_THAT(server_.creates(), IsEmpty());
}

TEST_F(Client, RefusesAFolderThatIsntThereBeforeAnyWork) {
    const auto result = remesh({"run", input_, "-o", "nowhere/a.ply"});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(server_.creates(), IsEmpty());
}

TEST_F(Client, LetsFormatChooseBetweenFormatsOfOneExtension) {
    remesh({"run", input_, "-o", "a.msh"});
    remesh({"run", input_, "-o", "a.msh", "--format", "msh22"});

    EXPECT_EQ(server_.creates().at(0).spec().outputs(0).format(), v1::FORMAT_MSH41);
    EXPECT_EQ(server_.creates().at(1).spec().outputs(0).format(), v1::FORMAT_MSH22);
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

TEST_F(Client, SendsBytesOnceThatTheServerHasAlready) {
    remesh({"submit", input_});
    remesh({"submit", input_});

    EXPECT_EQ(server_.uploads_with_bytes(), 1);
    EXPECT_THAT(server_.jobs(), SizeIs(2));
}

TEST_F(Client, SendsALargeFileInChunks) {
    const std::string large = folder_.file("large.stl", std::string(3'000'000, 'x'));

    EXPECT_EQ(remesh({"submit", large}).exit_code, 0);
    EXPECT_EQ(server_.uploads_with_bytes(), 1);
}

TEST_F(Client, SubmitsSeveralFilesAndPrintsANameALine) {
    const std::string other = folder_.file("other.stl", "solid other");

    const auto result = remesh({"submit", input_, other, "--edge-length", "1"});

    EXPECT_EQ(result.out, "tenants/default/jobs/001\ntenants/default/jobs/002\n");
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
    Connection connection({server_.address(), {}, std::chrono::milliseconds(1), {}}, {});
    const auto cancel_after_some_renewals = [&](const v1::JobEvent&) {
        if (server_.watches().size() == 4) {
            std::ignore = connection.cancel_job(job.name());
        }
    };
    const v1::Job end = follow(connection, job.name(), 0, cancel_after_some_renewals,
                               std::chrono::milliseconds(200));
    EXPECT_EQ(end.state(), v1::Job::STATE_CANCELLED);
    EXPECT_GE(server_.watches().size(), 4u);
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

TEST_F(Client, ListsEveryPageOneObjectALine) {
    server_.add_job({});
    server_.add_job({});

    const auto result = run_client(folder_, {"list", "--json", "--server", server_.address()});

    const auto lines = json_lines(result.out);
    ASSERT_THAT(lines, SizeIs(2));
    EXPECT_EQ(lines[0]["name"], "tenants/default/jobs/001");
    EXPECT_EQ(lines[0]["state"], "SUCCEEDED");
    EXPECT_EQ(lines[1]["name"], "tenants/default/jobs/002");
}

TEST_F(Client, GetsOutputsByExtension) {
    remesh({"run", input_});

    const auto result =
        remesh({"get", "tenants/default/jobs/001", "-o", "x.ply", "-o", "x.vtu", "-o", "x.json"});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(content_of(folder_.path() / "x.ply"), FakeServer::content_of(v1::FORMAT_PLY));
    EXPECT_EQ(content_of(folder_.path() / "x.vtu"), FakeServer::content_of(v1::FORMAT_VTU));
    EXPECT_EQ(content_of(folder_.path() / "x.json"), "{}");
}

TEST_F(Client, SaysWhatThereIsToGet) {
    remesh({"run", input_});

    const auto result = remesh({"get", "tenants/default/jobs/001", "-o", "x.obj"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.last_error_line(),
                HasSubstr("mesh.vtu (tetrahedra), mesh.ply (surface), report.json (report)"));
}

TEST_F(Client, SaysThatAJobIsntThere) {
    const auto result = remesh({"show", "tenants/default/jobs/none"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_EQ(result.last_error_line(), "remesh: no job tenants/default/jobs/none");
}

TEST_F(Client, KeepsControlCharactersOfALabelFromTheTerminal) {
    v1::Job job;
    (*job.mutable_spec()->mutable_labels())["note"] = "\x1b[2Jred\x07";
    const std::string name = server_.add_job(job).name();

    const auto result = remesh({"show", name});

    EXPECT_THAT(result.out, HasSubstr("note=?[2Jred?"));
}

TEST_F(Client, ReadsStdinAndWritesStdout) {
    const auto result = remesh({"run", "-", "-o", "-", "--format", "ply"}, "solid from a pipe");

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.out, FakeServer::content_of(v1::FORMAT_PLY));
    EXPECT_THAT(result.err, HasSubstr("wrote -"));
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

TEST_F(Client, DetachesOnTheFirstInterruptAndCancelsOnTheSecond) {
    server_.outcome = v1::Job::STATE_RUNNING;
    ClientProcess client(folder_, {"--server", server_.address(), "run", input_});
    server_.wait_for_watch();

    client.send(SIGINT);
    client.wait_for_error_text("Ctrl-C again");
    EXPECT_EQ(server_.jobs().at(0).state(), v1::Job::STATE_RUNNING);
    client.send(SIGINT);
    const auto result = client.wait();

    EXPECT_EQ(result.exit_code, 130);
    EXPECT_THAT(result.err, HasSubstr("watch tenants/default/jobs/001"));
    EXPECT_EQ(server_.jobs().at(0).state(), v1::Job::STATE_CANCELLED);
    EXPECT_THAT(folder_.names(), ElementsAre("in.stl"));
}

TEST_F(Client, LeavesTheJobAloneAfterOneInterrupt) {
    server_.outcome = v1::Job::STATE_RUNNING;
    ClientProcess client(folder_, {"--server", server_.address(), "run", input_});
    server_.wait_for_watch();

    client.send(SIGINT);
    const auto result = client.wait();

    EXPECT_EQ(result.exit_code, 130);
    EXPECT_EQ(server_.jobs().at(0).state(), v1::Job::STATE_RUNNING);
}

TEST_F(Client, NeedsAServerForJobsThatLive) {
    const auto result = run_client(folder_, {"list"});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.last_error_line(), HasSubstr("--server"));
}

TEST(LateServer, IsWaitedFor) {
    const TemporaryFolder folder;
    auto server = std::make_unique<FakeServer>();
    const std::string address = server->address();
    server.reset();

    ClientProcess client(folder, {"--server", address, "list"});
    client.wait_for_error_text("waiting for the server");
    server = std::make_unique<FakeServer>(std::stoi(address.substr(address.find(':') + 1)));
    const auto result = client.wait();

    EXPECT_EQ(result.exit_code, 0) << result.err;
}

/// Client with a program in the private server's place: it says its process id and hangs.
class PrivateServerTest : public Client {
protected:
    std::string program(const std::string& script) {
        const std::string path = folder_.file("remeshd", "#!/bin/sh\n" + script);
        std::filesystem::permissions(path, std::filesystem::perms::owner_all);
        return path;
    }
    std::string hanging_program() {
        return program("echo $$ > \"$TMPDIR/pid\"\nexec sleep 1000\n");
    }
    pid_t server_pid() { return std::stoi(wait_for_text(folder_.path() / "pid", "\n")); }
};

TEST_F(PrivateServerTest, SaysWhyItDidntStart) {
    const auto result =
        run_client(folder_, {"--remeshd", program("echo no disk >&2\nexit 9\n"), "run", input_});

    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(result.last_error_line(), "remesh: the private server ended with status 9: no disk");
    EXPECT_THAT(folder_.names(), ElementsAre("in.stl", "remeshd"));
}

TEST_F(PrivateServerTest, IsStoppedWhenTheClientIsInterrupted) {
    ClientProcess client(folder_, {"--remeshd", hanging_program(), "run", input_});
    const pid_t pid = server_pid();

    client.send(SIGINT);
    const auto result = client.wait();

    EXPECT_EQ(result.exit_code, 130);
    EXPECT_EQ(kill(pid, 0), -1);
    EXPECT_THAT(folder_.names(), ElementsAre("in.stl", "pid", "remeshd"));
}

TEST_F(PrivateServerTest, DiesWithAClientThatIsKilledAndTheNextOneCleansUp) {
    ClientProcess client(folder_, {"--remeshd", hanging_program(), "run", input_});
    const int server = static_cast<int>(syscall(SYS_pidfd_open, server_pid(), 0));

    client.send(SIGKILL);
    client.wait();

    pollfd ended{server, POLLIN, 0};
    EXPECT_EQ(poll(&ended, 1, 30'000), 1);
    close(server);
    EXPECT_THAT(folder_.names(), SizeIs(4));
    run_client(folder_, {"--remeshd", "/bin/false", "run", input_});
    EXPECT_THAT(folder_.names(), ElementsAre("in.stl", "pid", "remeshd"));
}

}  // namespace
}  // namespace remesh::client
