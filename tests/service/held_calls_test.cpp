// Calls whose replies nobody reads: what they may hold of the server.

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/store/sqlite.h"
#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::CallContext;
using testing::detail_of;
using testing::ScriptedEngine;
using testing::TestServer;

const ScriptedEngine kCopy;

/// Makes calls whose replies it never reads: each is larger than what may be on its way.
class Hoarder {
public:
    Hoarder(TestServer& server, std::string token) : token_(std::move(token)) {
        grpc::ChannelArguments arguments;
        arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
        arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
        jobs_ = v1::JobService::NewStub(grpc::CreateCustomChannel(
            server.address(), grpc::InsecureChannelCredentials(), arguments));
    }
    Hoarder(const Hoarder&) = delete;
    Hoarder& operator=(const Hoarder&) = delete;
    ~Hoarder() {
        release();
        queue_.Shutdown();
    }

    /// Asks for a job and waits until the server has begun to answer.
    void ask_for(const std::string& name) {
        send(name, &v1::JobService::Stub::AsyncGetJob);
        wait_for_one();
    }
    /// Makes a call about a job.
    template <typename Request>
    void send(const std::string& name,
              std::unique_ptr<grpc::ClientAsyncResponseReader<v1::Job>> (
                  v1::JobService::Stub::*method)(grpc::ClientContext*, const Request&,
                                                 grpc::CompletionQueue*)) {
        Request request;
        request.set_name(name);
        auto& call = calls_.emplace_back(std::make_unique<Call>(token_));
        call->reader = ((*jobs_).*method)(&call->context, request, &queue_);
        call->reader->ReadInitialMetadata(call.get());
        ++unanswered_;
    }
    /// Waits until the server has begun to answer one more.
    void wait_for_one() {
        wait();
        --unanswered_;
    }
    void wait_for_all() {
        while (unanswered_ > 0) {
            wait_for_one();
        }
    }
    /// Leaves without an answer.
    void release() {
        for (const auto& call : calls_) {
            call->context.TryCancel();
        }
        read();
    }
    /// Reads what the calls were answered with.
    std::vector<grpc::Status> read() {
        wait_for_all();
        std::vector<grpc::Status> statuses;
        for (const auto& call : calls_) {
            v1::Job job;
            call->reader->Finish(&job, &statuses.emplace_back(), call.get());
            wait();
        }
        calls_.clear();
        return statuses;
    }

private:
    struct Call {
        explicit Call(const std::string& token) : context(token) {}
        CallContext context;
        std::unique_ptr<grpc::ClientAsyncResponseReader<v1::Job>> reader{};
    };

    void wait() {
        void* tag = nullptr;
        bool ok = false;
        queue_.Next(&tag, &ok);
    }

    const std::string token_;
    std::unique_ptr<v1::JobService::Stub> jobs_;
    grpc::CompletionQueue queue_;
    std::vector<std::unique_ptr<Call>> calls_;
    int unanswered_ = 0;
};

/// A server of two clinics, one of which has a job that takes 800 kB to tell.
class HeldCalls : public ::testing::Test {
protected:
    void serve(const CallOptions& calls) {
        server.emplace(kCopy, [&](ServerOptions& options) {
            options.requires_credentials = true;
            options.calls = calls;
        });
        clinic = server->token_for("clinic");
        lab = server->token_for("lab");
        server->token = clinic;
        v1::CreateJobRequest request = server->request_for("mesh");
        auto* region = request.mutable_spec()->mutable_options()->mutable_sizing()->add_regions();
        region->set_size(1.0);
        region->mutable_points()->mutable_coordinates()->Resize(99'999, 1.0);
        v1::Job job;
        ASSERT_TRUE(server->create(request, &job).ok());
        name = job.name();
        // A call that was answered may be counted for a moment longer; now none is.
        server->stop();
        server->start();
    }
    grpc::Status call_as(const std::string& token) {
        CallContext context(token);
        v1::GetCapabilitiesResponse reply;
        return server->capabilities->GetCapabilities(&context, {}, &reply);
    }
    /// What a call is told once the server has noticed that those before it are gone.
    grpc::Status call_again() {
        grpc::Status status;
        do {
            status = call_as(clinic);
        } while (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED);
        return status;
    }

    std::optional<TestServer> server;
    std::string clinic;
    std::string lab;
    std::string name;
};

TEST_F(HeldCalls, AreLimitedInNumberForATenantAtATime) {
    serve({.max_calls_of_tenant = 2});
    Hoarder hoarder(*server, clinic);
    hoarder.ask_for(name);
    hoarder.ask_for(name);

    const grpc::Status refused = call_as(clinic);

    EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_EQ(refused.error_message(), "a tenant has at most 2 calls at a time");
    const auto details = detail_of<google::rpc::QuotaFailure>(refused);
    ASSERT_TRUE(details);
    EXPECT_EQ(details->violations(0).subject(), "tenants/clinic/calls");
    EXPECT_TRUE(detail_of<google::rpc::RetryInfo>(refused));
    EXPECT_TRUE(call_as(lab).ok()) << "it has its own";
    hoarder.release();
    EXPECT_TRUE(call_again().ok());
}

TEST_F(HeldCalls, AreLimitedInBytesForATenantAtATime) {
    serve({.max_bytes_of_tenant = 2'000'000});
    Hoarder hoarder(*server, clinic);
    hoarder.ask_for(name);
    ASSERT_TRUE(call_as(clinic).ok()) << "a reply is there twice, which is less than 2 MB";
    hoarder.ask_for(name);

    const grpc::Status refused = call_as(clinic);

    EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_EQ(refused.error_message(), "a tenant has at most 2000000 bytes of calls at a time");
    EXPECT_TRUE(call_as(lab).ok()) << "it has its own";
    hoarder.release();
    EXPECT_TRUE(call_again().ok());
}

TEST_F(HeldCalls, AreLimitedInBytesAlsoIfTheyWereLetInBefore) {
    constexpr int kCalls = 10;
    serve({.max_calls_of_tenant = kCalls, .max_bytes_of_tenant = 2'000'000});
    Hoarder laggard(*server, lab);
    Hoarder hoarder(*server, clinic);
    {
        // Whoever writes waits for the test; one call too many is refused, after all others wait.
        sqlite::Connection store((server->data_dir() / "remesh.sqlite").string(),
                                 sqlite::Connection::Mode::ReadWrite);
        const sqlite::Transaction nobody_else_writes(store);
        for (int i = 0; i <= kCalls; ++i) {
            laggard.send("tenants/lab/jobs/none", &v1::JobService::Stub::AsyncCancelJob);
        }
        laggard.wait_for_one();
        for (int i = 0; i <= kCalls; ++i) {
            hoarder.send(name, &v1::JobService::Stub::AsyncGetJob);
        }
        hoarder.wait_for_one();
    }
    hoarder.wait_for_all();

    int refused = 0;
    for (const grpc::Status& status : hoarder.read()) {
        refused += status.error_message() == "a tenant has at most 2000000 bytes of calls at a time"
                       ? 1
                       : 0;
    }

    // Two replies pass the bound, and three more may be at work by then.
    EXPECT_GE(refused, kCalls - 5);
}

TEST_F(HeldCalls, AreLimitedForAllTenantsTogether) {
    serve({.max_calls = 1});
    Hoarder hoarder(*server, clinic);
    hoarder.ask_for(name);

    EXPECT_EQ(call_as(lab).error_message(), "the server takes at most 1 calls at a time");
}

TEST_F(HeldCalls, ChangeNothingOnceTheyAreRefused) {
    serve({.max_bytes_of_tenant = 1'000'000});
    Hoarder hoarder(*server, clinic);
    hoarder.ask_for(name);
    v1::CreateJobRequest request;
    v1::Job job;

    EXPECT_EQ(server->create(request, &job).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_EQ(server->remove(name).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    hoarder.release();
    ASSERT_TRUE(call_again().ok());
    EXPECT_TRUE(server->get(name, &job).ok());
}

}  // namespace
}  // namespace remesh
