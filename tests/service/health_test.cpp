// grpc.health.v1.Health, which anybody may ask.

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "server/health_service.h"
#include "tests/support/silent_call.h"

namespace remesh {
namespace {

using testing::CallContext;
using testing::SilentCall;

const std::string kCheck = "/grpc.health.v1.Health/Check";
const std::string kWatch = "/grpc.health.v1.Health/Watch";
const std::string kAnyService;  // An empty HealthCheckRequest: the server as a whole.
const std::string kJobService = "\x0a\x01j";

/// A call to the service, in which messages are their bytes.
class HealthCall final : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
public:
    HealthCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
               const std::string& request) {
        grpc::GenericStub(channel).PrepareBidiStreamingCall(&context_, method, {}, this);
        const grpc::Slice bytes(request);
        request_ = grpc::ByteBuffer(&bytes, 1);
        StartWriteLast(&request_, {});
        StartRead(&response_);
        StartCall();
    }

    void OnReadDone(bool ok) override {
        grpc::Slice bytes;
        if (ok && response_.DumpToSingleSlice(&bytes).ok()) {
            told_.set_value({reinterpret_cast<const char*>(bytes.begin()), bytes.size()});
        }
    }
    void OnDone(const grpc::Status& status) override { done_.set_value(status); }

    /// Waits for the first message.
    [[nodiscard]] std::string told() { return told_.get_future().get(); }
    [[nodiscard]] grpc::Status end() { return done_.get_future().get(); }

private:
    CallContext context_;
    grpc::ByteBuffer request_{};
    grpc::ByteBuffer response_{};
    std::promise<std::string> told_{};
    std::promise<grpc::Status> done_{};
};

class Health : public ::testing::Test {
protected:
    Health() {
        grpc::ServerBuilder builder;
        builder.RegisterCallbackGenericService(&health_);
        server_ = builder.BuildAndStart();
        channel_ = server_->InProcessChannel({});
    }
    ~Health() override { server_->Shutdown(); }

    HealthService health_{3};
    std::unique_ptr<grpc::Server> server_;
    std::shared_ptr<grpc::Channel> channel_;
};

TEST_F(Health, IsServingUntilTheServerStops) {
    HealthCall before(channel_, kCheck, kAnyService);
    EXPECT_EQ(before.told(), "\x08\x01");
    EXPECT_TRUE(before.end().ok());

    health_.stop_serving();

    HealthCall after(channel_, kCheck, kAnyService);
    EXPECT_EQ(after.told(), "\x08\x02");
    EXPECT_TRUE(after.end().ok());
}

TEST_F(Health, IsKnownOfTheServerAsAWhole) {
    HealthCall check(channel_, kCheck, kJobService);
    EXPECT_EQ(check.end().error_code(), grpc::StatusCode::NOT_FOUND);
    HealthCall watch(channel_, kWatch, kJobService);
    EXPECT_EQ(watch.told(), "\x08\x03");
    health_.stop_serving();
    EXPECT_EQ(watch.end().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(Health, EndsItsWatchesWhenTheServerStops) {
    HealthCall watch(channel_, kWatch, kAnyService);
    EXPECT_EQ(watch.told(), "\x08\x01");

    health_.stop_serving();

    EXPECT_EQ(watch.end().error_code(), grpc::StatusCode::UNAVAILABLE);
    HealthCall late(channel_, kWatch, kAnyService);
    EXPECT_EQ(late.told(), "\x08\x02");
    EXPECT_EQ(late.end().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(Health, RefusesWhatIsNoRequest) {
    HealthCall call(channel_, kCheck, "\x0a\x7f");

    EXPECT_EQ(call.end().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(Health, HasNoOtherMethods) {
    const SilentCall call(channel_, "/remesh.v1.JobService/GuessJob");

    EXPECT_EQ(call.end().error_code(), grpc::StatusCode::UNIMPLEMENTED);
}

TEST_F(Health, IsAskedThoughStrangersHoldAllCalls) {
    std::vector<std::unique_ptr<SilentCall>> calls;
    for (int i = 0; i < 9; ++i) {
        calls.push_back(std::make_unique<SilentCall>(channel_, i % 2 == 0 ? kCheck : kWatch));
    }
    const auto has_ended = [](const auto& call) { return call->has_ended(); };
    // The last three have their places.
    while (std::count_if(calls.begin(), calls.end(), has_ended) < 6) {
        std::this_thread::yield();
    }

    HealthCall check(channel_, kCheck, kAnyService);
    EXPECT_EQ(check.told(), "\x08\x01");
    EXPECT_TRUE(check.end().ok());
}

}  // namespace
}  // namespace remesh
