#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "server/call.h"
#include "server/executor.h"
#include "server/tenant_slots.h"

namespace remesh {

struct CallOptions {
    int max_calls = 4'096;            ///< More unary calls at a time are refused.
    int max_calls_of_tenant = 1'024;  ///< More of one tenant, too.
    /// Of their requests and replies, in memory; beyond it no more are taken.
    std::int64_t max_bytes = std::int64_t{512} << 20;
    std::int64_t max_bytes_of_tenant = std::int64_t{128} << 20;  ///< Of one tenant's.
};

/// Where unary calls are let in and wait for their turn. Each is its tenant's, with its bytes,
/// until whoever asked has the whole reply or is gone: a reply that nobody reads stays in memory
/// for as long as its reader likes.
class Reception {
public:
    using Handler = std::function<void(const Principal& who, std::string& subject)>;

    /// A call as gRPC hands it over; it owns the messages.
    struct Call {
        grpc::CallbackServerContext* context;
        const google::protobuf::Message* request;
        google::protobuf::Message* reply;
    };

    Reception(Gate& gate, Executor& executor, const CallOptions& options);

    /// Answers a call by `guarded`, where it may block. The handler fills in the reply.
    grpc::ServerUnaryReactor* answer(const Call& call, const Rule& rule, Handler handler);
    /// The same for calls that look into a file, which takes seconds: one looks at a time, and only
    /// so many wait. Not with the others, whom they would hold up.
    grpc::ServerUnaryReactor* inspect(const Call& call, const Rule& rule, Handler handler);

private:
    class Reactor;
    /// Lets a call in: runs `take(tenant)`, which takes a place for it, then hands it over to
    /// `executor`.
    grpc::ServerUnaryReactor* receive(
        const Call& call, const Rule& rule, Executor& executor,
        const std::function<std::shared_ptr<void>(const std::string& tenant)>& take,
        Handler handler);
    void run(Reactor& reactor, const Call& call, const Rule& rule, const Handler& handler,
             std::shared_ptr<void> place);

    Gate& gate_;
    Executor& executor_;
    TenantSlots calls_;
    TenantSlots bytes_;
    TenantSlots inspections_{"inspections", 16, 8};
    // They hold what is above.
    Executor inspector_{1};
    /// Lets callers in and does nothing else, so that what waits to be counted goes fast.
    Executor porter_{1};
};

}  // namespace remesh
