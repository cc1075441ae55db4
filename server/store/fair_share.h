#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace remesh {

// How tenants share the workers: whoever runs the fewest jobs for its weight is next; among equals
// the one that has used the least, by a running account of seconds over weight (start-time fair
// queueing). A tenant that comes back after a while starts at the present level, so that it can't
// live on what it didn't use.

/// One tenant with a job that could be claimed.
struct TenantLoad {
    std::string tenant{};
    int weight = 1;
    std::int64_t running = 0;
    std::optional<std::int64_t> max_running{};
    std::int64_t used = 0;  ///< Its account, microseconds over weight.
};

/// Index of the tenant whose turn it is, or nothing if all run as much as they may.
/// \param level  account of the tenant that was served last, before it was charged
[[nodiscard]] std::optional<std::size_t> next_tenant(std::span<const TenantLoad> loads,
                                                     std::int64_t level);

/// What a claim costs at once, so that tenants with waiting jobs take turns.
[[nodiscard]] std::int64_t charge_of_claim(int weight);
/// What else an attempt costs when it ends. A clock that jumped costs a day at most.
[[nodiscard]] std::int64_t charge_of_attempt(std::chrono::microseconds run_time, int weight);

}  // namespace remesh
