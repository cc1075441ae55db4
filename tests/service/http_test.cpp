#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <atomic>
#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "server/http_server.h"
#include "server/store/digest.h"
#include "tests/support/certificates.h"
#include "tests/support/scripted_engine.h"
#include "tests/support/temporary_directory.h"
#include "tests/support/test_server.h"

// Last: it brings resolv.h, whose macro _res is a name in Eigen's headers.
#include <httplib.h>

namespace remesh::testing {
namespace {

using nlohmann::json;

const httplib::Headers kOwn{{"X-Remesh", "1"}};
// Of clients; their own is 5 s, which a busy machine may need.
constexpr int kPatience = 300;

/// A server with its HTTP port, and a client of that.
class HttpTest : public ::testing::Test {
protected:
    void SetUp() override { start(engine_); }

    void start(const Engine& engine) {
        http_.reset();
        server_ = std::make_unique<TestServer>(engine);
        open();
    }
    void open() {
        http_ = std::make_unique<HttpServer>(
            HttpOptions{.address = "127.0.0.1:0"},
            HttpServer::Sources{
                .api = server_->server().in_process_channel(),
                .is_ready = [this] { return server_->server().is_ready(); },
                .metrics = [this] { return server_->server().metrics().text(); },
                .count_response =
                    [this](int status) { server_->server().metrics().count_response(status); }});
        client_ = std::make_unique<httplib::Client>("127.0.0.1", http_->port());
        client_->set_read_timeout(kPatience);
    }

    json create(const std::string& bytes) {
        const std::string sha256 = sha256_of(bytes);
        client_->Put("/api/v1/artifacts/" + sha256, kOwn, bytes, "application/octet-stream");
        const json request{{"spec",
                            {{"input",
                              {{"digest", {{"sha256", sha256}, {"size_bytes", bytes.size()}}},
                               {"file_name", "<b>\"in\".stl"}}},
                             {"outputs", {{{"format", "FORMAT_STL"}}}}}}};
        const auto reply = client_->Post("/api/v1/jobs", kOwn, request.dump(), "application/json");
        EXPECT_EQ(reply->status, 200) << reply->body;
        return json::parse(reply->body);
    }
    /// The events of a job until its stream ends, as they are sent.
    std::string events(const std::string& name, const httplib::Headers& headers = {}) {
        std::string text;
        client_->Get("/api/v1/" + name + "/events", headers, [&](const char* data, size_t size) {
            text.append(data, size);
            return true;
        });
        return text;
    }

    ScriptedEngine engine_{};
    std::unique_ptr<TestServer> server_;
    std::unique_ptr<HttpServer> http_;
    std::unique_ptr<httplib::Client> client_;
};

TEST_F(HttpTest, AnswersProbes) {
    EXPECT_EQ(client_->Get("/healthz")->status, 200);
    EXPECT_EQ(client_->Get("/readyz")->status, 200);
    EXPECT_EQ(client_->Get("/metrics")->status, 200);
}

TEST_F(HttpTest, RunsAJobFromUploadToDownload) {
    const json job = create("a surface");
    const std::string name = job.at("name");

    const std::string told = events(name);
    const json done = json::parse(client_->Get("/api/v1/" + name)->body);
    const std::string digest = done.at("result").at("outputs").at(0).at("digest").at("sha256");
    const auto file = client_->Get("/api/v1/artifacts/" + digest + "?name=out%22.stl");

    EXPECT_EQ(done.at("state"), "STATE_SUCCEEDED");
    EXPECT_EQ(done.at("spec").at("input").at("file_name"), "<b>\"in\".stl");
    EXPECT_NE(told.find("event: completed"), std::string::npos);
    EXPECT_EQ(file->body, "out:a surface");
    // This client takes the percent signs out again.
    EXPECT_EQ(file->get_header_value("Content-Disposition"),
              "attachment; filename*=UTF-8''out\".stl");
    EXPECT_EQ(file->get_header_value("Content-Type"), "application/octet-stream");
}

TEST_F(HttpTest, SendsARangeOfAFile) {
    const json job = create("0123456789");
    const std::string digest = job.at("spec").at("input").at("digest").at("sha256");

    const auto part = client_->Get("/api/v1/artifacts/" + digest, {{"Range", "bytes=2-4"}});

    EXPECT_EQ(part->status, 206);
    EXPECT_EQ(part->body, "234");
}

TEST_F(HttpTest, GoesOnAfterTheLastEventSeen) {
    const json job = create("a surface");
    const std::string name = job.at("name");
    const std::string all = events(name);
    ASSERT_NE(all.find("id: 1\n"), std::string::npos);
    ASSERT_NE(all.find("id: 2\n"), std::string::npos);

    const std::string rest = events(name, {{"Last-Event-ID", "1"}});

    EXPECT_EQ(rest.find("id: 1\n"), std::string::npos);
    EXPECT_NE(rest.find("id: 2\n"), std::string::npos);
    EXPECT_NE(rest.find("event: completed"), std::string::npos);
}

TEST_F(HttpTest, TellsTheQueueAtOnce) {
    create("a surface");

    std::string text;
    client_->Get("/api/v1/events", [&](const char* data, size_t size) {
        text.append(data, size);
        return text.find("event: summary") == std::string::npos;
    });

    EXPECT_EQ(text.rfind("event: jobs\ndata: {", 0), 0U);
    EXPECT_NE(text.find("STATE_"), std::string::npos);
    EXPECT_NE(text.find(R"("tenant":"default")"), std::string::npos);
}

TEST_F(HttpTest, SaysWhatIsWrongAsTheApiDoes) {
    const auto missing = client_->Get("/api/v1/tenants/default/jobs/none");
    const auto bad =
        client_->Post("/api/v1/jobs", kOwn, R"({"spec": {"priority": 999}})", "application/json");
    const auto broken = client_->Post("/api/v1/jobs", kOwn, "{", "application/json");

    EXPECT_EQ(missing->status, 404);
    EXPECT_EQ(json::parse(missing->body).at("error").at("reason"), "JOB_NOT_FOUND");
    EXPECT_EQ(bad->status, 400);
    EXPECT_NE(bad->body.find("spec.priority"), std::string::npos);
    EXPECT_EQ(broken->status, 400);
}

TEST_F(HttpTest, RetriesAJobThatFailedAsANewOne) {
    std::atomic<bool> is_broken = true;
    const ScriptedEngine failing([&](const JobRequest& request, const JobFiles& input,
                                     RunContext& run, OutputSink& outputs) {
        if (is_broken) {
            throw remesh::Error(ErrorCode::Unmeshable, "not this time");
        }
        return ScriptedEngine::copy_input(request, input, run, outputs);
    });
    start(failing);
    const std::string name = create("a surface").at("name");
    server_->wait_for(name, v1::Job::STATE_FAILED);
    is_broken = false;

    const auto retry = [&](const std::string& body) {
        return client_->Post("/api/v1/" + name + ":retry", kOwn, body, "application/json");
    };
    const auto first = retry(R"({"request_id": "once"})");
    const auto again = retry(R"({"request_id": "once"})");
    const auto other = retry("");

    ASSERT_EQ(first->status, 200) << first->body;
    const json job = json::parse(first->body);
    EXPECT_NE(job.at("name"), name);
    EXPECT_EQ(job.at("origin"), name);
    EXPECT_EQ(json::parse(again->body).at("name"), job.at("name"));
    EXPECT_NE(json::parse(other->body).at("name"), job.at("name"));
    server_->wait_for(job.at("name"), v1::Job::STATE_SUCCEEDED);
    const auto refused = client_->Post("/api/v1/" + job.at("name").get<std::string>() + ":retry",
                                       kOwn, "", "application/json");
    EXPECT_EQ(refused->status, 400);
    EXPECT_EQ(json::parse(refused->body).at("error").at("reason"), "JOB_NOT_RETRYABLE");
    server_.reset();
}

TEST_F(HttpTest, KeepsOtherSitesOut) {
    const auto form = client_->Post("/api/v1/jobs", "{}", "application/json");
    const auto rebound = client_->Get("/", {{"Host", "evil.example"}});
    const auto posing = client_->Get("/", {{"Host", "127.0.0.1.evil.example"}});
    const auto loopback = client_->Get("/api/v1/jobs", {{"Host", "localhost:8080"}});

    EXPECT_EQ(form->status, 403);
    EXPECT_EQ(rebound->status, 421);
    EXPECT_EQ(posing->status, 421);
    EXPECT_EQ(loopback->status, 200);
}

TEST_F(HttpTest, AllowsNothingFromElsewhereOnAnyPage) {
    for (const char* path : {"/", "/api/v1/jobs", "/none"}) {
        const auto reply = client_->Get(path);
        const std::string policy = reply->get_header_value("Content-Security-Policy");
        EXPECT_EQ(policy.rfind("default-src 'none'", 0), 0U) << path;
        EXPECT_EQ(reply->get_header_value("X-Content-Type-Options"), "nosniff") << path;
    }
}

TEST_F(HttpTest, ShowsPagesOfUsersInASandbox) {
    const json job = create("<script>alert(1)</script>");
    const std::string digest = job.at("spec").at("input").at("digest").at("sha256");

    const auto page = client_->Get("/api/v1/artifacts/" + digest + "?view");

    EXPECT_EQ(
        page->get_header_value("Content-Security-Policy").rfind("sandbox; default-src 'none'", 0),
        0U);
}

TEST_F(HttpTest, EndsItsStreamsWhenItEnds) {
    Gate gate;
    const ScriptedEngine waiting(behind(gate));
    start(waiting);
    const std::string name = create("a surface").at("name");
    std::atomic<bool> is_open = false;
    std::thread reader([&, port = http_->port()] {
        httplib::Client other("127.0.0.1", port);
        other.set_read_timeout(kPatience);
        other.Get("/api/v1/" + name + "/events", [&](const char*, size_t) {
            is_open = true;
            is_open.notify_all();
            return true;
        });
    });
    is_open.wait(false);

    http_.reset();  // would wait for ever if the stream went on
    reader.join();

    gate.open();
    server_->wait_for(name, v1::Job::STATE_SUCCEEDED);
    server_.reset();
}

TEST_F(HttpTest, CallsNothingOnceItsApiIsClosed) {
    const json job = create("a surface");
    const std::string digest = job.at("spec").at("input").at("digest").at("sha256");
    const std::string name = job.at("name");

    http_->close_api();

    for (const std::string& path : {std::string("/api/v1/jobs"), std::string("/api/v1/events"),
                                    "/api/v1/" + name + "/events", "/api/v1/artifacts/" + digest}) {
        const auto reply = client_->Get(path);
        EXPECT_EQ(reply->status, 503) << path;
        EXPECT_EQ(json::parse(reply->body).at("error").at("reason"), "SHUTTING_DOWN") << path;
        EXPECT_EQ(reply->get_header_value("Retry-After"), "5") << path;
    }
    EXPECT_EQ(client_->Put("/api/v1/artifacts/" + digest, kOwn, "a surface", "text/plain")->status,
              503);
    EXPECT_EQ(client_->Get("/healthz")->status, 200);
}

/// An API that takes one token only.
class GuardedJobs final : public v1::JobService::Service {
    grpc::Status ListJobs(grpc::ServerContext* context, const v1::ListJobsRequest*,
                          v1::ListJobsResponse*) override {
        const auto found = context->client_metadata().find("authorization");
        const bool is_known =
            found != context->client_metadata().end() &&
            std::string(found->second.data(), found->second.size()) == "Bearer sesame";
        return is_known ? grpc::Status::OK
                        : grpc::Status(grpc::StatusCode::UNAUTHENTICATED, "who are you?");
    }
};

class SignInTest : public ::testing::Test {
protected:
    void SetUp() override {
        api_ = grpc::ServerBuilder().RegisterService(&jobs_).BuildAndStart();
        http_ = std::make_unique<HttpServer>(HttpOptions{.address = "127.0.0.1:0"}, sources());
        client_ = std::make_unique<httplib::Client>("127.0.0.1", http_->port());
        client_->set_read_timeout(kPatience);
    }
    void TearDown() override {
        http_.reset();
        api_->Shutdown();
    }

    HttpServer::Sources sources() {
        return {.api = api_->InProcessChannel({}),
                .is_ready = [] { return true; },
                .metrics = [] { return std::string(); },
                .count_response = [](int) {}};
    }

    GuardedJobs jobs_;
    std::unique_ptr<grpc::Server> api_;
    std::unique_ptr<HttpServer> http_;
    std::unique_ptr<httplib::Client> client_;
};

TEST_F(SignInTest, RefusesWhoHasNoToken) {
    EXPECT_EQ(client_->Get("/api/v1/jobs")->status, 401);
    EXPECT_EQ(client_->Get("/api/v1/events")->status, 401);
    EXPECT_EQ(client_->Get("/metrics")->status, 401);
    EXPECT_EQ(client_->Get("/healthz")->status, 200);
}

TEST_F(SignInTest, TakesATokenAsAHeader) {
    const httplib::Headers token{{"Authorization", "Bearer sesame"}};

    EXPECT_EQ(client_->Get("/api/v1/jobs", token)->status, 200);
    EXPECT_EQ(client_->Get("/metrics", token)->status, 200);
}

TEST_F(SignInTest, KeepsATokenInACookieThatScriptsCannotRead) {
    const auto wrong =
        client_->Post("/api/v1/session", kOwn, R"({"token": "wrong"})", "application/json");
    const auto right =
        client_->Post("/api/v1/session", kOwn, R"({"token": "sesame"})", "application/json");
    const std::string cookie = right->get_header_value("Set-Cookie");

    EXPECT_EQ(wrong->status, 401);
    EXPECT_FALSE(wrong->has_header("Set-Cookie"));
    EXPECT_EQ(right->status, 204);
    EXPECT_EQ(cookie, "remesh_token=sesame; Path=/; HttpOnly; SameSite=Strict");
    EXPECT_EQ(client_->Get("/api/v1/jobs", {{"Cookie", "a=b; remesh_token=sesame"}})->status, 200);
    EXPECT_EQ(client_->Get("/api/v1/jobs", {{"Cookie", "xremesh_token=sesame"}})->status, 401);
}

TEST_F(SignInTest, SaysWhetherThereIsASessionToEnd) {
    const auto without = client_->Get("/api/v1/session");
    const auto with = client_->Get("/api/v1/session", {{"Cookie", "remesh_token=sesame"}});

    EXPECT_EQ(json::parse(without->body).at("signed_in"), false);
    EXPECT_EQ(json::parse(with->body).at("signed_in"), true);
    EXPECT_EQ(with->body.find("sesame"), std::string::npos);
}

TEST_F(SignInTest, TakesNoTokenThatBreaksOutOfItsCookie) {
    const auto reply = client_->Post("/api/v1/session", kOwn, R"({"token": "a; Domain=evil"})",
                                     "application/json");

    EXPECT_EQ(reply->status, 401);
    EXPECT_FALSE(reply->has_header("Set-Cookie"));
}

TEST_F(SignInTest, ServesACertificateThatWasRenewed) {
    const TemporaryDirectory directory;
    const auto path = [&](const char* name) { return (directory.path() / name).string(); };
    const auto write = [&](const char* name, const std::string& content) {
        std::ofstream(path(name)) << content;
        return path(name);
    };
    const Authority first;
    const Authority second;
    const Identity old = first.issue("IP:127.0.0.1");
    const Identity renewed = second.issue("IP:127.0.0.1");
    const HttpServer server(HttpOptions{.address = "127.0.0.1:0",
                                        .tls_certificate = write("server.pem", old.certificate),
                                        .tls_key = write("server.key", old.key),
                                        .tls_refresh = std::chrono::milliseconds(0)},
                            sources());
    const auto is_trusted_by = [&](const Authority& authority) {
        httplib::SSLClient client("127.0.0.1", server.port());
        client.set_read_timeout(kPatience);
        client.set_ca_cert_path(write("ca.pem", authority.certificate()).c_str());
        const auto reply = client.Get("/healthz");
        return reply && reply->status == 200;
    };

    EXPECT_TRUE(is_trusted_by(first));
    EXPECT_FALSE(is_trusted_by(second));
    write("server.key", renewed.key);  // doesn't fit its certificate yet
    EXPECT_TRUE(is_trusted_by(first));
    write("server.pem", renewed.certificate);
    EXPECT_TRUE(is_trusted_by(second));
    EXPECT_FALSE(is_trusted_by(first));
}

TEST_F(SignInTest, DoesntStartWithAKeyThatIsntItsCertificates) {
    const TemporaryDirectory directory;
    const Authority authority;
    const std::string certificate = directory.path() / "server.pem";
    const std::string key = directory.path() / "server.key";
    std::ofstream(certificate) << authority.issue("IP:127.0.0.1").certificate;
    std::ofstream(key) << authority.issue("IP:127.0.0.1").key;

    EXPECT_THROW(
        HttpServer(
            HttpOptions{.address = "127.0.0.1:0", .tls_certificate = certificate, .tls_key = key},
            sources()),
        std::runtime_error);
}

}  // namespace
}  // namespace remesh::testing
