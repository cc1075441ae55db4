#include "client/follow.h"

#include <algorithm>
#include <memory>
#include <optional>

#include "client/failure.h"
#include "client/stubs.h"

namespace remesh::client {
namespace {

/// A stream is opened anew after this long, so that a server that vanished without a word is
/// noticed; reconnecting loses nothing.
constexpr Connection::Milliseconds kLongestStream = std::chrono::minutes(2);

}  // namespace

v1::Job follow(Connection& connection, const std::string& name, std::int64_t after,
               const std::function<void(const v1::JobEvent&)>& on_event) {
    v1::WatchJobRequest request;
    request.set_name(name);
    request.set_after_sequence(after);
    std::optional<v1::Job> last;

    connection.retry(kLongestStream, [&](grpc::ClientContext& context) {
        const auto stream = connection.stubs().jobs.WatchJob(&context, request);
        v1::JobEvent event;
        while (stream->Read(&event)) {
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
        const bool is_over = status.ok() && last && is_terminal(last->state());
        const bool can_go_on =
            status.ok() || status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
        return is_over || !can_go_on
                   ? status
                   : grpc::Status(grpc::StatusCode::UNAVAILABLE, "the watch ended too early");
    });
    return *last;
}

}  // namespace remesh::client
