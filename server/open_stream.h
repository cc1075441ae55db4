#pragma once

#include <grpcpp/support/status.h>

#include <cstddef>
#include <exception>
#include <string>
#include <utility>

#include "server/auth/principal.h"
#include "server/convert.h"
#include "server/executor.h"

namespace remesh {

/// Opens a stream that a hub will feed: on the executor, since both may block, `admission(target)`
/// says what it is opened for and `start(stream, target)` hands it to the hub. Until then it is the
/// executor's alone; if either refuses, it is finished.
template <typename Target, typename Stream, typename Admission, typename Start>
Stream* open_stream(Executor& executor, Stream* stream, Admission admission, Start start) {
    executor.post([stream, admission = std::move(admission), start = std::move(start)] {
        Target target;
        grpc::Status status = admission(target);
        if (status.ok()) {
            try {
                status = start(*stream, target);
            } catch (const std::exception&) {
                status = to_status(std::current_exception());
            }
        }
        if (!status.ok()) {
            stream->Finish(status);
        }
    });
    return stream;
}

/// What opens a stream is kept until it ends, and is small unless somebody means harm.
/// \throws JobError{BadRequest} if it takes more than 64 KiB
inline void require_small_request(std::size_t bytes) {
    constexpr std::size_t kMaxBytes = 65'536;
    if (bytes > kMaxBytes) {
        refuse("request", "must take at most " + std::to_string(kMaxBytes) + " bytes, got " +
                              std::to_string(bytes));
    }
}

/// Of a stream whose caller may no longer follow.
inline grpc::Status credential_ended_status() {
    return to_status(std::make_exception_ptr(
        AccessError(AccessErrorCode::Unauthenticated, "the credential isn't valid any more")));
}

}  // namespace remesh
