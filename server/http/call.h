#pragma once

#include <grpcpp/client_context.h>
#include <grpcpp/support/sync_stream.h>

#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>

namespace remesh::http {

/// No call may begin any more.
class ShuttingDown : public std::exception {
public:
    [[nodiscard]] const char* what() const noexcept override { return "shutting down"; }
};

/// Calls that wait for the API, so that a server that ends can end them.
class OpenCalls {
public:
    /// Cancels what waits, and returns once nothing is about to begin: a call that begins on the
    /// in-process channel of a gRPC 1.51 server that is gone crashes.
    void close() {
        std::unique_lock lock(mutex_);
        is_closed_ = true;
        for (grpc::ClientContext* context : contexts_) {
            context->TryCancel();
        }
        has_begun_.wait(lock, [this] { return beginning_ == 0; });
    }

private:
    friend class Call;

    std::mutex mutex_;
    std::condition_variable has_begun_;
    std::set<grpc::ClientContext*> contexts_;  // needs mutex_
    int beginning_ = 0;                        // needs mutex_
    bool is_closed_ = false;                   // needs mutex_
};

/// The context of one call to the API, made with the credential of the request that it serves.
class Call {
public:
    /// \throws ShuttingDown once `calls` are closed
    Call(OpenCalls& calls, const std::string& token) : calls_(calls) {
        if (!token.empty()) {
            context_.AddMetadata("authorization", "Bearer " + token);
        }
        const std::scoped_lock lock(calls_.mutex_);
        if (calls_.is_closed_) {
            throw ShuttingDown();
        }
        calls_.contexts_.insert(&context_);
        ++calls_.beginning_;
    }
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;
    ~Call() {
        set_begun();
        const std::scoped_lock lock(calls_.mutex_);
        calls_.contexts_.erase(&context_);
    }

    [[nodiscard]] grpc::ClientContext* context() { return &context_; }
    /// A stream is there, however long it may go on.
    void set_begun() {
        if (!std::exchange(has_begun_, true)) {
            const std::scoped_lock lock(calls_.mutex_);
            --calls_.beginning_;
            calls_.has_begun_.notify_all();
        }
    }
    void cancel() { context_.TryCancel(); }

private:
    OpenCalls& calls_;
    grpc::ClientContext context_;
    bool has_begun_ = false;
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
    void start(std::unique_ptr<grpc::ClientReader<Message>> reader) {
        reader_ = std::move(reader);
        call_.set_begun();
    }
    bool read(Message* message) { return reader_->Read(message); }
    /// After the last message.
    grpc::Status finish() { return std::exchange(reader_, nullptr)->Finish(); }

private:
    Call call_;
    std::unique_ptr<grpc::ClientReader<Message>> reader_;
};

}  // namespace remesh::http
