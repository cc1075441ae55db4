// The real programs: remesh and remeshd, from the command line to the files.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <fstream>
#include <optional>
#include <signal.h>
#include <sstream>

#include "tests/service/client_process.h"
#include "tests/support/certificates.h"

namespace remesh::client {
namespace {

namespace fs = std::filesystem;
using remesh::testing::Authority;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const std::string kAorta = std::string(REMESH_TEST_DATA_DIR) + "/aorta.stl";

std::string line_of(const std::string& text) {
    return text.substr(0, text.find('\n'));
}

/// A remeshd of the test's own, on any port.
class ServerProcess {
public:
    explicit ServerProcess(std::vector<std::string> flags = {}) {
        flags.insert(flags.begin(), {"serve", "--data-dir", data_dir(), "--listen", "127.0.0.1:0",
                                     "--port-file", folder_.path() / "port", "--threads", "1"});
        process_.emplace(folder_, flags, ProcessOptions{.program = REMESH_SERVER_PROGRAM});
        port_ = line_of(wait_for_text(folder_.path() / "port", "\n"));
    }
    [[nodiscard]] std::string address() const { return "127.0.0.1:" + port_; }
    [[nodiscard]] std::string data_dir() const { return folder_.path() / "data"; }
    /// Asks it to end. \return how it did
    ClientResult stop() {
        process_->send(SIGTERM);
        return process_->wait();
    }

private:
    TemporaryFolder folder_;
    std::optional<ClientProcess> process_;
    std::string port_;
};

ClientResult run_remeshd(const TemporaryFolder& folder, const std::vector<std::string>& arguments) {
    return run_client(folder, arguments, {.program = REMESH_SERVER_PROGRAM});
}

class Programs : public ::testing::Test {
protected:
    /// Without a server named: the private one is beside the tests' own programs.
    ClientResult remesh(std::vector<std::string> arguments) const {
        arguments.insert(arguments.begin(), {"--remeshd", REMESH_SERVER_PROGRAM});
        return run_client(folder_, arguments);
    }
    [[nodiscard]] std::string written(const std::string& name) const {
        return content_of(folder_.path() / name);
    }

    TemporaryFolder folder_;
};

TEST_F(Programs, MakeAMeshWithAPrivateServer) {
    const auto result = remesh({"run", kAorta, "--edge-length", "5", "-o", "a.vtu", "-o", "a.ply"});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(written("a.vtu"), HasSubstr("UnstructuredGrid"));
    EXPECT_THAT(written("a.ply"), StartsWith("ply\n"));
    EXPECT_THAT(result.out, HasSubstr("edge length h = 5"));
    EXPECT_THAT(folder_.names(), ElementsAre("a.ply", "a.vtu"));
}

TEST_F(Programs, SubmitWatchAndGetFromANamedServer) {
    ServerProcess server;
    const std::string to = server.address();

    const auto submitted =
        run_client(folder_, {"--server", to, "submit", kAorta, "--edge-length", "5"});
    const std::string name = line_of(submitted.out);
    const std::string id = name.substr(name.rfind('/') + 1);
    const auto watched = run_client(folder_, {"--server", to, "watch", id});
    const auto got = run_client(folder_, {"--server", to, "get", id, "-o", "a.vtu"});
    const auto stopped = server.stop();

    EXPECT_THAT(name, StartsWith("tenants/default/jobs/"));
    EXPECT_EQ(watched.exit_code, 0) << watched.err;
    EXPECT_THAT(watched.out, HasSubstr("SUCCEEDED"));
    EXPECT_EQ(got.exit_code, 0) << got.err;
    EXPECT_THAT(written("a.vtu"), HasSubstr("UnstructuredGrid"));
    EXPECT_EQ(stopped.exit_code, 0);
    EXPECT_THAT(stopped.err, Not(HasSubstr("aorta"))) << "names of files are in the log";
}

TEST_F(Programs, KeepTheDraftsOfAResultThatBreaksABound) {
    ServerProcess server;
    const auto client = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"--server", server.address()});
        return run_client(folder_, words);
    };

    const auto refused = client({"run", kAorta, "--edge-length", "5", "--min-dihedral", "70", "-o",
                                 "a.vtu", "--report", "q.json"});
    const std::string name = nlohmann::json::parse(line_of(client({"--json", "list"}).out))["name"];
    const auto got = client({"get", name, "-o", "draft.vtu"});
    const auto retried = client({"retry", name});
    const std::string again = line_of(retried.out);
    const auto watched = client({"watch", again});
    const auto shown = nlohmann::json::parse(client({"--json", "show", again}).out);

    EXPECT_EQ(refused.exit_code, 4);
    EXPECT_THAT(refused.last_error_line(), HasSubstr("min_dihedral"));
    EXPECT_TRUE(nlohmann::json::parse(written("q.json")).contains("bounds"));
    EXPECT_EQ(got.exit_code, 0) << got.err;
    EXPECT_THAT(written("draft.vtu"), HasSubstr("UnstructuredGrid"));
    EXPECT_THAT(folder_.names(), ElementsAre("draft.vtu", "q.json"));
    EXPECT_EQ(watched.exit_code, 4);
    EXPECT_EQ(shown["failure"]["reason"], "BOUND_NOT_MET");
    EXPECT_EQ(shown["origin"], name);
}

TEST_F(Programs, RunAJobAnewThatWasRunBeforeIfAskedTo) {
    ServerProcess server;
    const auto attempts_of = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"--server", server.address(), "--json", "run", kAorta,
                                     "--edge-length", "6", "--surface-only"});
        return nlohmann::json::parse(run_client(folder_, words).out).value("attempt", 0);
    };

    EXPECT_EQ(attempts_of({"-o", "a.ply"}), 1);
    EXPECT_EQ(attempts_of({"-o", "a.ply"}), 0) << "answered by the first one's result";
    EXPECT_EQ(attempts_of({"-o", "a.ply", "--skip-cache"}), 1);
}

TEST_F(Programs, EstimateAJobWithoutRunningIt) {
    const auto told = remesh({"--json", "run", kAorta, "--edge-length", "5", "--estimate"});
    const std::string bad = folder_.file("bad.off", "OFF\n3 7 0\n0 0 0\n");
    const auto refused = remesh({"run", bad, "--estimate"});

    ASSERT_EQ(told.exit_code, 0) << told.err;
    const auto job = nlohmann::json::parse(told.out);
    EXPECT_GT(job["estimate"]["tets"], 1'000);
    EXPECT_EQ(job["name"], "");
    EXPECT_EQ(refused.exit_code, 3);
    EXPECT_THAT(refused.last_error_line(), HasSubstr("OFF"));
    EXPECT_THAT(folder_.names(), ElementsAre("bad.off"));
}

/// A MetaImage of 20 mm voxels that covers the aorta, all of one size.
std::string size_image(float size, const std::string& offset) {
    std::string file =
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nElementByteOrderMSB = False\n"
        "Offset = " +
        offset +
        "\nElementSpacing = 20 20 20\nDimSize = 30 30 30\nElementType = MET_FLOAT\n"
        "ElementDataFile = LOCAL\n";
    for (int i = 0; i < 30 * 30 * 30; ++i) {
        file.append(reinterpret_cast<const char*>(&size), sizeof size);
    }
    return file;
}

TEST_F(Programs, MakeAMeshWithSizesFromAnImage) {
    const std::string sizes = folder_.file("sizes.mha", size_image(4.0F, "-300 0 0"));
    const std::string apart_image = folder_.file("apart.mha", size_image(4.0F, "9000 0 0"));
    const std::string detached =
        folder_.file("none.mha", "ObjectType = Image\nElementDataFile = /etc/passwd\n");
    const std::vector<std::string> job{"run",        kAorta,  "--edge-length", "5",
                                       "--max-size", "8",     "--space",       "lps",
                                       "-o",         "a.vtu", "--json",        "--size-image"};
    const auto with = [&](std::vector<std::string> words) {
        words.insert(words.begin(), job.begin(), job.end());
        return remesh(words);
    };

    const auto made = with({sizes, "--no-thickness-guard", "--return-sizes"});
    const auto estimated = with({sizes, "--estimate"});
    const auto apart = with({apart_image});
    const auto apart_in_estimate = with({apart_image, "--estimate"});
    const auto refused = with({detached});
    const auto unreadable = with({"missing.mha"});

    EXPECT_EQ(made.exit_code, 0) << made.err;
    EXPECT_THAT(made.out, HasSubstr("\"size_image\""));
    EXPECT_EQ(estimated.exit_code, 0) << estimated.err;
    EXPECT_EQ(apart.exit_code, 3) << apart.err;
    EXPECT_THAT(apart.err, HasSubstr("must overlap the surface"));
    EXPECT_EQ(apart_in_estimate.exit_code, 3) << apart_in_estimate.err;
    EXPECT_THAT(apart_in_estimate.err, HasSubstr("must overlap the surface"));
    EXPECT_EQ(refused.exit_code, 3) << refused.err;
    EXPECT_THAT(refused.err, HasSubstr("ElementDataFile must be LOCAL"));
    EXPECT_EQ(unreadable.exit_code, 3);
    EXPECT_THAT(unreadable.err, HasSubstr("can't read missing.mha"));
}

TEST_F(Programs, LimitATenantAsItsOperatorSays) {
    ServerProcess server;
    const auto admin = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"admin", "tenant"});
        words.insert(words.end(), {"--data-dir", server.data_dir()});
        return run_remeshd(folder_, words);
    };
    const std::vector<std::string> submit{"--server", server.address(), "submit", kAorta};

    const auto set = admin({"set", "default", "--weight", "3", "--max-queued", "0"});
    const auto refused = run_client(folder_, submit);
    admin({"set", "default", "--max-queued", "default"});
    const auto taken = run_client(folder_, submit);
    const auto shown = nlohmann::json::parse(admin({"show", "default"}).out);

    EXPECT_EQ(set.exit_code, 0) << set.err;
    EXPECT_EQ(refused.exit_code, 7) << refused.err;
    EXPECT_EQ(taken.exit_code, 0) << taken.err;
    EXPECT_EQ(shown["weight"], 3);
    EXPECT_FALSE(shown.contains("max_queued"));
    EXPECT_GT(shown["stored_bytes"], 0);
    EXPECT_NE(admin({"set", "No Name", "--weight", "3"}).exit_code, 0);
}

TEST_F(Programs, RefuseAnOptionOutOfRangeByItsName) {
    const auto result = remesh({"run", kAorta, "--damping", "7", "-o", "a.ply"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.last_error_line(),
                StartsWith("remesh: spec.options.relaxation.damping must be in (0, 2]"));
    EXPECT_THAT(folder_.names(), ::testing::IsEmpty());
}

TEST_F(Programs, RefuseAFileThatIsNoMesh) {
    const std::string file = folder_.file("bad.stl", "solid nothing at all");

    const auto result = remesh({"run", file, "-o", "a.ply"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.last_error_line(), HasSubstr("STL"));
    EXPECT_THAT(folder_.names(), ElementsAre("bad.stl"));
}

TEST_F(Programs, InspectAFile) {
    const auto result = remesh({"--json", "inspect", kAorta});

    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto inspection = nlohmann::json::parse(result.out);
    EXPECT_EQ(inspection["format"], "STL");
    EXPECT_GT(inspection["triangles"], 100);
    EXPECT_GT(inspection["suggested_edge_length"], 0.0);
}

TEST_F(Programs, InspectAFileThatIsNoMesh) {
    const std::string file = folder_.file("bad.off", "OFF\n3 7 0\n0 0 0\n");

    const auto result = remesh({"inspect", file});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.last_error_line(), HasSubstr("OFF"));
}

TEST_F(Programs, LeaveNothingWhenInterrupted) {
    ClientProcess client(folder_, {"--remeshd", REMESH_SERVER_PROGRAM, "run", kAorta,
                                   "--edge-length", "0.3", "-o", "a.vtu"});
    while (folder_.names().empty()) {  // Until its server has a folder.
        wait_for_text(folder_.path() / "none", "");
    }

    client.send(SIGINT);
    const auto result = client.wait();

    EXPECT_EQ(result.exit_code, 130);
    EXPECT_THAT(folder_.names(), ::testing::IsEmpty());
}

TEST_F(Programs, LeaveTheJobWithItsServerWhenInterrupted) {
    ServerProcess server;
    ClientProcess client(folder_, {"--server", server.address(), "run", kAorta, "--edge-length",
                                   "0.3", "-o", "a.vtu"});
    std::string jobs;
    while (jobs.find("RUNNING") == std::string::npos) {
        jobs = run_client(folder_, {"--server", server.address(), "list"}).out;
    }

    client.send(SIGINT);
    const auto result = client.wait();

    EXPECT_EQ(result.exit_code, 130);
    EXPECT_THAT(result.err, HasSubstr("watch tenants/default/jobs/"));
    EXPECT_THAT(run_client(folder_, {"--server", server.address(), "list"}).out,
                HasSubstr("RUNNING"));
}

TEST_F(Programs, SayAtOnceThatThePrivateServerDied) {
    // A server that takes its own life as soon as it has its socket.
    const std::string program =
        folder_.file("remeshd", "#!/bin/sh\n" REMESH_SERVER_PROGRAM
                                " \"$@\" & while [ ! -S \"${5#unix:}\" ]; do :; done\n"
                                "kill -9 $!\nwait $!\necho out of memory >&2\nexit 9\n");
    fs::permissions(program, fs::perms::owner_all);

    const auto result = run_client(folder_, {"--remeshd", program, "run", kAorta});

    EXPECT_EQ(result.exit_code, 4);
    EXPECT_EQ(result.last_error_line(),
              "remesh: the private server ended with status 9: out of memory");
}

TEST_F(Programs, SpeakTlsAndAskForATokenBeyondThisMachine) {
    const Authority authority;
    const auto identity = authority.issue("IP:127.0.0.1");
    const std::string ca = folder_.file("ca.pem", authority.certificate());
    ServerProcess server({"--auth", "--tls-cert", folder_.file("s.pem", identity.certificate),
                          "--tls-key", folder_.file("s.key", identity.key)});
    const std::string token =
        line_of(run_remeshd(folder_, {"admin", "token", "create", "--data-dir", server.data_dir(),
                                      "--tenant", "clinic"})
                    .out);
    const std::vector<std::string> list{"--server", server.address(), "--tls-ca", ca, "list"};

    const auto stranger = run_client(folder_, list);
    const auto clinic = run_client(folder_, list, {.environment = {"REMESH_TOKEN=" + token}});
    const auto health =
        run_remeshd(folder_, {"healthcheck", "--server", server.address(), "--tls-ca", ca});
    const auto audit =
        run_remeshd(folder_, {"admin", "audit", "verify", "--data-dir", server.data_dir()});

    EXPECT_EQ(stranger.exit_code, 7);
    EXPECT_THAT(stranger.last_error_line(), HasSubstr("token"));
    EXPECT_EQ(clinic.exit_code, 0) << clinic.err;
    EXPECT_EQ(health.exit_code, 0);
    EXPECT_EQ(audit.exit_code, 0) << audit.err;
    EXPECT_THAT(audit.out, StartsWith("2:"));
}

TEST_F(Programs, DontListenBeyondThisMachineUnprotected) {
    const std::string data = folder_.path() / "data";

    const auto bare = run_remeshd(folder_, {"serve", "--data-dir", data, "--listen", "0.0.0.0:0"});
    const auto open =
        run_remeshd(folder_, {"serve", "--data-dir", data, "--listen", "0.0.0.0:0", "--auth"});

    EXPECT_EQ(bare.exit_code, 1);
    EXPECT_THAT(bare.err, HasSubstr("--tls-cert"));
    EXPECT_EQ(open.exit_code, 1);
    EXPECT_FALSE(fs::exists(data));
}

}  // namespace
}  // namespace remesh::client
