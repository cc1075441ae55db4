// Where the client program takes its settings from, how it is interrupted, and its private server.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/syscall.h>

#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include "tests/service/client_fixture.h"

namespace remesh::client {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

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
    const std::string address = "unix:" + (folder.path() / "s").string();

    ClientProcess client(folder, {"--server", address, "--timeout", "300", "list"});
    client.wait_for_error_text("waiting for the server");
    const FakeServer server(address);
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
    EXPECT_EQ(poll(&ended, 1, 300'000), 1);
    close(server);
    EXPECT_THAT(folder_.names(), SizeIs(4));
    run_client(folder_, {"--remeshd", "/bin/false", "run", input_});
    EXPECT_THAT(folder_.names(), ElementsAre("in.stl", "pid", "remeshd"));
}

}  // namespace
}  // namespace remesh::client
