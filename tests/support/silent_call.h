#pragma once

#include <grpcpp/generic/generic_stub.h>

#include <future>
#include <memory>
#include <string>

#include "tests/support/test_server.h"

namespace remesh::testing {

/// A call that is opened and never gets a message.
class SilentCall final : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
public:
    SilentCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
               const std::string& token = {})
        : context_(token) {
        grpc::GenericStub(channel).PrepareBidiStreamingCall(&context_, method, {}, this);
        StartCall();
    }
    SilentCall(const SilentCall&) = delete;
    SilentCall& operator=(const SilentCall&) = delete;
    ~SilentCall() override {
        context_.TryCancel();
        end_.wait();
    }

    void OnDone(const grpc::Status& status) override { done_.set_value(status); }

    /// Waits until the server ends it.
    [[nodiscard]] grpc::Status end() const { return end_.get(); }
    [[nodiscard]] bool has_ended() const {
        return end_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    }

private:
    CallContext context_;
    std::promise<grpc::Status> done_{};
    std::shared_future<grpc::Status> end_ = done_.get_future().share();
};

}  // namespace remesh::testing
