// TLS: who may listen in, who is let in by certificate, and certificates that change.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <fstream>
#include <sstream>
#include <unistd.h>
#include <vector>

#include "server/healthcheck.h"
#include "tests/service/prometheus_text.h"
#include "tests/support/certificates.h"
#include "tests/support/silent_call.h"
#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::Authority;
using testing::CallContext;
using ::testing::HasSubstr;
using testing::Identity;
using ::testing::Not;
using testing::PrometheusText;
using testing::ScriptedEngine;
using testing::SilentCall;
using testing::TemporaryDirectory;
using testing::TestServer;

const ScriptedEngine kCopy;

class Tls : public ::testing::Test {
protected:
    Tls() {
        write("server-ca.pem", server_authority_.certificate());
        write("client-ca.pem", client_authority_.certificate());
        give(server_authority_.issue("IP:127.0.0.1"));
    }

    void write(const std::string& name, const std::string& content) const {
        const auto file = directory_.path() / name;
        std::ofstream(file.string() + ".new") << content;
        std::filesystem::rename(file.string() + ".new", file);
    }
    void give(const Identity& identity) const {
        write("server.key", identity.key);
        write("server.pem", identity.certificate);
    }
    std::function<void(ServerOptions&)> with_tls() const {
        return [this](ServerOptions& options) {
            options.requires_credentials = true;
            options.tls = {directory_.path() / "server.pem", directory_.path() / "server.key",
                           directory_.path() / "client-ca.pem", std::chrono::seconds(1)};
        };
    }
    std::shared_ptr<grpc::ChannelCredentials> trusting(const Authority& authority,
                                                       const Identity& own = {}) const {
        return grpc::SslCredentials({authority.certificate(), own.key, own.certificate});
    }
    static grpc::Status ask(TestServer& server) {
        CallContext context(server.token);
        v1::GetCapabilitiesResponse reply;
        return server.capabilities->GetCapabilities(&context, {}, &reply);
    }

    TemporaryDirectory directory_;
    Authority server_authority_;
    Authority client_authority_;
};

TEST_F(Tls, LetsATokenInOverAChannelThatTrustsTheServer) {
    TestServer server(kCopy, with_tls());
    server.connect(trusting(server_authority_));

    EXPECT_EQ(ask(server).error_code(), grpc::StatusCode::UNAUTHENTICATED);
    server.token = server.token_for("clinic");
    EXPECT_TRUE(ask(server).ok());
}

TEST_F(Tls, IsntSpokenToInTheClear) {
    TestServer server(kCopy, with_tls());
    server.connect(grpc::InsecureChannelCredentials());

    EXPECT_EQ(ask(server).error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(Tls, IsntTrustedWithAnotherAuthority) {
    TestServer server(kCopy, with_tls());
    server.connect(trusting(client_authority_));

    EXPECT_EQ(ask(server).error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(Tls, LetsInAClientCertificateForItsTenant) {
    TestServer server(kCopy, with_tls());
    AccessStore(server.data_dir())
        .allow_certificate("pipeline", {"clinic", Role::User, "", {}}, system_now());

    server.connect(trusting(server_authority_, client_authority_.issue("DNS:pipeline")));

    EXPECT_THAT(server.create("mesh").name(), ::testing::StartsWith("tenants/clinic/jobs/"));
}

TEST_F(Tls, DoesntLetInACertificateForAnotherName) {
    TestServer server(kCopy, with_tls());
    AccessStore(server.data_dir())
        .allow_certificate("pipeline", {"clinic", Role::User, "", {}}, system_now());

    server.connect(trusting(server_authority_, client_authority_.issue("DNS:pipelin")));

    EXPECT_EQ(ask(server).error_code(), grpc::StatusCode::UNAUTHENTICATED);
}

TEST_F(Tls, DoesntLetInACertificateOfAnotherAuthority) {
    TestServer server(kCopy, with_tls());
    AccessStore(server.data_dir())
        .allow_certificate("pipeline", {"clinic", Role::User, "", {}}, system_now());

    server.connect(trusting(server_authority_, server_authority_.issue("DNS:pipeline")));

    EXPECT_FALSE(ask(server).ok());
}

TEST_F(Tls, EndsCallsOfStrangersWithoutWaitingForTheirMessages) {
    TestServer server(kCopy, with_tls());
    server.connect(trusting(server_authority_));
    for (int i = 0; i < Gate::kStrangers; ++i) {
        EXPECT_EQ(ask(server).error_code(), grpc::StatusCode::UNAUTHENTICATED);
    }

    const SilentCall stranger(server.channel, "/remesh.v1.JobService/GetJob");
    EXPECT_EQ(stranger.end().error_code(), grpc::StatusCode::UNAUTHENTICATED);
    EXPECT_EQ(stranger.end().error_message(), "a valid token or client certificate is needed");
    const SilentCall forger(server.channel, "/remesh.v1.JobService/WatchJob", "remesh_1");
    EXPECT_EQ(forger.end().error_code(), grpc::StatusCode::UNAUTHENTICATED);

    EXPECT_TRUE(is_serving(server.address(), server_authority_.certificate()));
    server.token = server.token_for("clinic");
    EXPECT_TRUE(ask(server).ok());
    server.connect(trusting(server_authority_, client_authority_.issue("DNS:pipeline")));
    AccessStore(server.data_dir())
        .allow_certificate("pipeline", {"clinic", Role::User, "", {}}, system_now());
    server.token.clear();
    EXPECT_TRUE(ask(server).ok());
}

TEST_F(Tls, ShowsTheContractByReflectionToNoStranger) {
    TestServer server(kCopy, [&](ServerOptions& options) {
        with_tls()(options);
        options.with_reflection = true;
    });
    server.connect(trusting(server_authority_));
    const std::string method = "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo";

    const SilentCall stranger(server.channel, method);
    const SilentCall known(server.channel, method, server.token_for("clinic"));

    EXPECT_EQ(stranger.end().error_code(), grpc::StatusCode::UNAUTHENTICATED);
    EXPECT_FALSE(known.has_ended());
}

TEST_F(Tls, TakesUpACertificateThatWasReplaced) {
    TestServer server(kCopy, with_tls());
    server.token = server.token_for("clinic");
    const Authority successor;

    give(successor.issue("IP:127.0.0.1"));

    // The files are looked at once a second; each attempt is a connection of its own.
    grpc::Status status;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(5);
    do {
        server.connect(trusting(successor));
        status = ask(server);
    } while (!status.ok() && std::chrono::steady_clock::now() < deadline);
    EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST_F(Tls, RefusesToStartWithAKeyThatIsntTheCertificates) {
    write("server.key", server_authority_.issue("IP:127.0.0.1").key);

    EXPECT_THROW(TestServer(kCopy, with_tls()), std::runtime_error);
}

TEST_F(Tls, RefusesToStartWithoutItsFiles) {
    std::filesystem::remove(directory_.path() / "server.pem");

    EXPECT_THROW(TestServer(kCopy, with_tls()), std::runtime_error);
}

/// What is logged in a scope.
class Log {
public:
    Log() {
        spdlog::set_default_logger(std::make_shared<spdlog::logger>(
            "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(out_)));
    }
    Log(const Log&) = delete;
    Log& operator=(const Log&) = delete;
    ~Log() { spdlog::set_default_logger(before_); }
    [[nodiscard]] std::string text() const { return out_.str(); }

private:
    std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
    std::ostringstream out_;
};

TEST_F(Tls, WarnsOfACertificateThatHasEnded) {
    give(server_authority_.issue("IP:127.0.0.1",
                                 std::chrono::system_clock::now() - std::chrono::minutes(1)));
    Log log;
    TestServer server(kCopy, with_tls());
    server.stop();

    EXPECT_THAT(log.text(), HasSubstr("event=certificate_expired file=" +
                                      (directory_.path() / "server.pem").string()));
    EXPECT_THAT(log.text(), Not(HasSubstr("certificate_expires_soon")));
}

TEST_F(Tls, WarnsOfACertificateThatEndsWithinAWeek) {
    give(server_authority_.issue("IP:127.0.0.1",
                                 std::chrono::system_clock::now() + std::chrono::days(6)));
    Log log;
    TestServer server(kCopy, with_tls());
    server.stop();

    EXPECT_THAT(log.text(), HasSubstr("event=certificate_expires_soon file=" +
                                      (directory_.path() / "server.pem").string() + " hours=14"));
    EXPECT_THAT(log.text(), Not(HasSubstr("certificate_expired")));
}

TEST_F(Tls, SaysNothingOfACertificateThatLasts) {
    Log log;
    TestServer server(kCopy, with_tls());
    server.stop();

    EXPECT_THAT(log.text(), Not(HasSubstr("event=certificate")));
}

TEST_F(Tls, TellsPrometheusWhenTheCertificateEnds) {
    const auto series = "remesh_certificate_expiry_timestamp_seconds";
    constexpr std::int64_t kYear2100 = 4'102'444'800;
    constexpr std::int64_t kYear2060 = 2'840'140'800;
    const auto until = [this](std::int64_t end) {
        give(server_authority_.issue(
            "IP:127.0.0.1", std::chrono::system_clock::time_point(std::chrono::seconds(end))));
    };
    until(kYear2100);
    TestServer server(kCopy, with_tls());
    const auto told = [&] {
        const PrometheusText text(server.server().metrics().text());
        return static_cast<std::int64_t>(text.value(series).value_or(0.0));
    };

    EXPECT_EQ(told(), kYear2100);
    until(kYear2060);
    EXPECT_EQ(told(), kYear2060) << "it was replaced";
    write("server.pem", "half of");
    EXPECT_EQ(told(), kYear2060) << "the old one is still served";
}

/// Connections that somebody opens and never uses.
class IdleConnections {
public:
    explicit IdleConnections(int port) {
        address_.sin_family = AF_INET;
        address_.sin_port = htons(static_cast<std::uint16_t>(port));
        address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    }
    ~IdleConnections() { close(); }
    void open(int count) {
        for (int i = 0; i < count; ++i) {
            sockets_.push_back(::socket(AF_INET, SOCK_STREAM, 0));
            ::connect(sockets_.back(), reinterpret_cast<const sockaddr*>(&address_),
                      sizeof address_);
        }
    }
    void close() {
        for (const int socket : sockets_) {
            ::close(socket);
        }
        sockets_.clear();
    }

private:
    sockaddr_in address_{};
    std::vector<int> sockets_;
};

TEST(Connections, BeyondTheBoundAreClosedAndTheServerGoesOn) {
    // The test's own ends of the connections count, too: they're in the same process.
    TestServer server(kCopy, [](ServerOptions& options) { options.max_connections = 100; });
    const auto colon = server.address().rfind(':');
    IdleConnections idle(std::stoi(server.address().substr(colon + 1)));
    const auto ask = [&server] {
        server.connect(grpc::InsecureChannelCredentials());
        CallContext context;
        v1::GetCapabilitiesResponse reply;
        return server.capabilities->GetCapabilities(&context, {}, &reply);
    };

    idle.open(300);
    const grpc::Status while_full = ask();
    idle.close();
    grpc::Status afterwards;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(5);
    do {
        afterwards = ask();
    } while (!afterwards.ok() && std::chrono::steady_clock::now() < deadline);

    EXPECT_EQ(while_full.error_code(), grpc::StatusCode::UNAVAILABLE);
    EXPECT_TRUE(afterwards.ok()) << afterwards.error_message();
}

}  // namespace
}  // namespace remesh
