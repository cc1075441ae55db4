#include "server/health_service.h"

#include <google/protobuf/wrappers.pb.h>
#include <grpcpp/impl/codegen/proto_utils.h>

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "server/convert.h"

namespace remesh {
namespace {

constexpr std::string_view kCheck = "/grpc.health.v1.Health/Check";
constexpr std::string_view kWatch = "/grpc.health.v1.Health/Watch";

/// HealthCheckResponse.ServingStatus.
enum Serving : int { kServing = 1, kNotServing = 2, kServiceUnknown = 3 };

// grpc++ has no classes for the messages. A HealthCheckRequest is a string of field 1, and a
// HealthCheckResponse a number of field 1: on the wire they are what protobuf's wrappers are.

/// The service that a request asks for, unless it is none.
std::optional<std::string> service_in(grpc::ByteBuffer& message) {
    using Request = google::protobuf::StringValue;
    Request request;
    return grpc::SerializationTraits<Request>::Deserialize(&message, &request).ok()
               ? std::optional(request.value())
               : std::nullopt;
}

grpc::ByteBuffer response_of(Serving serving) {
    google::protobuf::Int32Value response;
    response.set_value(serving);
    const grpc::Slice bytes(response.SerializeAsString());
    return {&bytes, 1};
}

}  // namespace

/// One call. Whoever takes it off the service's list finishes it; until then it is alive.
class HealthService::Call final : public grpc::ServerGenericBidiReactor {
public:
    Call(HealthService& service, grpc::GenericCallbackServerContext& context)
        : service_(service), context_(context), is_watch_(context.method() == kWatch) {
        StartRead(&message_);
    }

    void OnReadDone(bool ok) override {
        const auto asked = ok ? service_in(message_) : std::nullopt;
        if (!asked) {
            end({grpc::StatusCode::INVALID_ARGUMENT, "a HealthCheckRequest is needed"});
        } else if (!asked->empty() && !is_watch_) {
            end({grpc::StatusCode::NOT_FOUND, "only the server as a whole is known: service \"\""});
        } else {
            answer(asked->empty());
        }
    }
    void OnWriteDone(bool /*ok*/) override {
        if (!is_watch_) {
            end(grpc::Status::OK);
        } else if (!service_.is_serving()) {
            end(shutting_down_status());
        }
    }
    void OnCancel() override { end({grpc::StatusCode::CANCELLED, "the client left"}); }
    void OnDone() override { delete this; }

    void end(const grpc::Status& status) {
        if (service_.take(*this)) {
            Finish(status);
        }
    }
    /// Ends it though its reader may never take what was written. Only for who took it.
    void drop() {
        context_.TryCancel();
        Finish({grpc::StatusCode::CANCELLED, "too many ask at a time"});
    }

private:
    friend class HealthService;

    void answer(bool is_known) {
        const std::scoped_lock lock(service_.mutex_);
        if (place_) {  // Else whoever took it may have finished it already.
            message_ = response_of(!is_known              ? kServiceUnknown
                                   : service_.is_serving_ ? kServing
                                                          : kNotServing);
            StartWrite(&message_);
        }
    }

    HealthService& service_;
    grpc::GenericCallbackServerContext& context_;
    const bool is_watch_;
    grpc::ByteBuffer message_{};
    std::optional<std::list<Call*>::iterator> place_{};  // needs service_.mutex_
};

grpc::ServerGenericBidiReactor* HealthService::CreateReactor(
    grpc::GenericCallbackServerContext* context) {
    if (context->method() != kCheck && context->method() != kWatch) {
        return CallbackGenericService::CreateReactor(context);
    }
    auto* call = new Call(*this, *context);
    Call* oldest = nullptr;
    {
        const std::scoped_lock lock(mutex_);
        call->place_ = calls_.insert(calls_.end(), call);
        if (calls_.size() > max_calls_) {
            oldest = calls_.front();
            oldest->place_.reset();
            calls_.pop_front();
        }
    }
    if (oldest != nullptr) {
        oldest->drop();
    }
    return call;
}

void HealthService::stop_serving() {
    std::list<Call*> calls;
    {
        const std::scoped_lock lock(mutex_);
        is_serving_ = false;
        calls = std::exchange(calls_, {});
        for (Call* call : calls) {
            call->place_.reset();
        }
    }
    for (Call* call : calls) {
        call->Finish(shutting_down_status());
    }
}

bool HealthService::take(Call& call) {
    const std::scoped_lock lock(mutex_);
    if (!call.place_) {
        return false;
    }
    calls_.erase(*call.place_);
    call.place_.reset();
    return true;
}

bool HealthService::is_serving() {
    const std::scoped_lock lock(mutex_);
    return is_serving_;
}

}  // namespace remesh
