#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <utility>

#include "server/call.h"
#include "server/executor.h"
#include "server/tenant_slots.h"

namespace remesh {

/// Where calls wait that look into a file, which takes seconds: one looks at a time, and only so
/// many wait. Not with the others, whom they would hold up.
class InspectionQueue {
public:
    /// As `remesh::answer`, in its turn. Whoever may not make the call, and whose tenant has enough
    /// of them waiting, is told so at once, on `executor`.
    template <typename Handler>
    grpc::ServerUnaryReactor* answer(Gate& gate, Executor& executor,
                                     grpc::CallbackServerContext* context, const Rule& rule,
                                     Handler handler) {
        auto* reactor = context->DefaultReactor();
        executor.post([this, &gate, context, rule, reactor, handler = std::move(handler)] {
            std::shared_ptr<void> place;
            const Rule only_admit{rule.action, rule.least, false};
            const grpc::Status status = guarded(
                gate, *context, only_admit,
                [&](const Principal& who, std::string&) { place = places_.take(who.tenant); });
            if (!status.ok()) {
                reactor->Finish(status);
                return;
            }
            executor_.post(
                [&gate, context, rule, reactor, handler, place = std::move(place)]() mutable {
                    const grpc::Status said = guarded(gate, *context, rule, handler);
                    place.reset();  // Before the answer, so that whoever gets it finds it free.
                    reactor->Finish(said);
                });
        });
        return reactor;
    }

private:
    TenantSlots places_{"inspections", 16, 8};
    Executor executor_{1};  // Its calls hold places.
};

}  // namespace remesh
