#include "server/reception.h"

#include <utility>

namespace remesh {

/// A call until its reply was sent, which may take for ever.
class Reception::Reactor final : public grpc::ServerUnaryReactor {
public:
    void OnDone() override { delete this; }

    /// Ends a call without a reply. To read that may take for ever, too, so it keeps nothing.
    void turn_down(const Call& what, const grpc::Status& status) {
        free_content(*what.request);
        free_content(*what.reply);
        request.reset();
        Finish(status);
    }

    // The executors', one after the other, until it is finished.
    std::string tenant{};
    std::shared_ptr<void> call{};
    std::shared_ptr<void> request{};
    std::shared_ptr<void> reply{};
};

Reception::Reception(Gate& gate, Executor& executor, const CallOptions& options)
    : gate_(gate),
      executor_(executor),
      calls_("calls", options.max_calls, options.max_calls_of_tenant),
      bytes_("bytes of calls", options.max_bytes, options.max_bytes_of_tenant) {}

grpc::ServerUnaryReactor* Reception::answer(const Call& call, const Rule& rule, Handler handler) {
    return receive(
        call, rule, executor_, [](const std::string&) { return nullptr; }, std::move(handler));
}

grpc::ServerUnaryReactor* Reception::inspect(const Call& call, const Rule& rule, Handler handler) {
    return receive(
        call, rule, inspector_,
        [this](const std::string& tenant) { return inspections_.take(tenant); },
        std::move(handler));
}

grpc::ServerUnaryReactor* Reception::receive(
    const Call& call, const Rule& rule, Executor& executor,
    const std::function<std::shared_ptr<void>(const std::string& tenant)>& take, Handler handler) {
    auto* reactor = new Reactor;
    porter_.post([this, reactor, call, rule, &executor, take, handler = std::move(handler)] {
        std::shared_ptr<void> place;
        const Rule only_admit{rule.action, rule.least, false};
        const grpc::Status status =
            guarded(gate_, *call.context, only_admit, [&](const Principal& who, std::string&) {
                reactor->tenant = who.tenant;
                reactor->call = calls_.take(who.tenant);
                reactor->request = bytes_.take(
                    who.tenant, static_cast<std::int64_t>(call.request->SpaceUsedLong()));
                place = take(who.tenant);
            });
        if (!status.ok()) {
            reactor->turn_down(call, status);
            return;
        }
        executor.post([this, reactor, call, rule, handler, place = std::move(place)]() mutable {
            run(*reactor, call, rule, handler, std::move(place));
        });
    });
    return reactor;
}

void Reception::run(Reactor& reactor, const Call& call, const Rule& rule, const Handler& handler,
                    std::shared_ptr<void> place) {
    const grpc::Status status =
        guarded(gate_, *call.context, rule, [&](const Principal& who, std::string& subject) {
            // Before anything is done, since what was done can't be refused. What is at work now
            // may pass the limit, by a few replies.
            bytes_.require_room(who.tenant);
            handler(who, subject);
        });
    place.reset();  // Before the answer, so that whoever gets it finds it free.
    if (!status.ok()) {
        reactor.turn_down(call, status);
        return;
    }
    // It is kept twice, as it is and as it will be sent.
    reactor.reply = bytes_.hold(
        reactor.tenant,
        static_cast<std::int64_t>(call.reply->SpaceUsedLong() + call.reply->ByteSizeLong()));
    reactor.Finish(status);
}

}  // namespace remesh
