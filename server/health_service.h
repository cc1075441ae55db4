#pragma once

#include <grpcpp/generic/async_generic_service.h>

#include <cstddef>
#include <list>
#include <mutex>

namespace remesh {

/// grpc.health.v1.Health of the server as a whole: Check and Watch. Every other method that no
/// service has is UNIMPLEMENTED.
///
/// Anybody may ask, so all who do share a bounded number of calls: beyond it, the oldest ends.
/// gRPC's own health service has no such bound; and only a generic service sees calls before their
/// first message, which may never come.
class HealthService final : public grpc::CallbackGenericService {
public:
    explicit HealthService(std::size_t max_calls) : max_calls_(max_calls) {}

    grpc::ServerGenericBidiReactor* CreateReactor(
        grpc::GenericCallbackServerContext* context) override;

    /// Says NOT_SERVING from now on, and ends all watches.
    void stop_serving();

private:
    class Call;

    /// Takes a call off the list. \return false if somebody else has done it, and finishes it
    bool take(Call& call);
    [[nodiscard]] bool is_serving();

    const std::size_t max_calls_;
    std::mutex mutex_;
    std::list<Call*> calls_{};  // needs mutex_; those that nobody has ended, the oldest first
    bool is_serving_ = true;    // needs mutex_
};

}  // namespace remesh
