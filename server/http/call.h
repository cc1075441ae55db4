#pragma once

#include <grpcpp/client_context.h>
#include <grpcpp/support/sync_stream.h>

#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>

namespace remesh::http {

/// Calls that wait for the API, so that a server that ends can end them.
class OpenCalls {
public:
    void close() {
        const std::scoped_lock lock(mutex_);
        is_closed_ = true;
        for (grpc::ClientContext* context : contexts_) {
            context->TryCancel();
        }
    }

private:
    friend class Call;

    std::mutex mutex_;
    std::set<grpc::ClientContext*> contexts_;  // needs mutex_
    bool is_closed_ = false;                   // needs mutex_
};

/// The context of one call to the API, made with the credential of the request that it serves.
class Call {
public:
    Call(OpenCalls& calls, const std::string& token) : calls_(calls) {
        if (!token.empty()) {
            context_.AddMetadata("authorization", "Bearer " + token);
        }
        const std::scoped_lock lock(calls_.mutex_);
        calls_.contexts_.insert(&context_);
        if (calls_.is_closed_) {
            context_.TryCancel();
        }
    }
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;
    ~Call() {
        const std::scoped_lock lock(calls_.mutex_);
        calls_.contexts_.erase(&context_);
    }

    [[nodiscard]] grpc::ClientContext* context() { return &context_; }
    void cancel() { context_.TryCancel(); }

private:
    OpenCalls& calls_;
    grpc::ClientContext context_;
};

/// A call whose answer is a stream. Left early, it's cancelled.
template <typename Message>
class StreamCall {
public:
    StreamCall(OpenCalls& calls, const std::string& token) : call_(calls, token) {}
    StreamCall(const StreamCall&) = delete;
    StreamCall& operator=(const StreamCall&) = delete;
    ~StreamCall() {
        if (reader_) {
            call_.cancel();
            reader_->Finish();
        }
    }

    [[nodiscard]] grpc::ClientContext* context() { return call_.context(); }
    void start(std::unique_ptr<grpc::ClientReader<Message>> reader) { reader_ = std::move(reader); }
    bool read(Message* message) { return reader_->Read(message); }
    /// After the last message.
    grpc::Status finish() { return std::exchange(reader_, nullptr)->Finish(); }

private:
    Call call_;
    std::unique_ptr<grpc::ClientReader<Message>> reader_;
};

}  // namespace remesh::http
