#include "client/follow.h"

#include <algorithm>
#include <memory>
#include <optional>

#include "client/failure.h"
#include "client/stubs.h"

namespace remesh::client {
v1::Job follow(Connection& connection, const std::string& name, std::int64_t after,
               const std::function<void(const v1::JobEvent&)>& on_event,
               Connection::Milliseconds longest) {
    v1::WatchJobRequest request;
    request.set_name(name);
    request.set_after_sequence(after);
    std::optional<v1::Job> last;

    bool is_over = false;
    const auto watch_once = [&](grpc::ClientContext& context) {
        const auto stream = connection.stubs().jobs.WatchJob(&context, request);
        bool was_heard = false;
        v1::JobEvent event;
        while (stream->Read(&event)) {
            was_heard = true;
            connection.note_contact();
            request.set_after_sequence(std::max(request.after_sequence(), event.sequence()));
            on_event(event);
            if (event.has_snapshot()) {
                last = event.snapshot();
            } else if (event.has_completed()) {
                last = event.completed();
            }
        }
        const grpc::Status status = stream->Finish();
        is_over = status.ok() && last && is_terminal(last->state());
        const bool is_renewal =
            was_heard && status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
        if (is_over || is_renewal) {
            return grpc::Status::OK;
        }
        const bool can_go_on =
            status.ok() || status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
        return can_go_on ? grpc::Status(grpc::StatusCode::UNAVAILABLE, "the watch ended too early")
                         : status;
    };
    while (!is_over) {
        connection.retry(longest, watch_once);
    }
    return *last;
}

}  // namespace remesh::client
