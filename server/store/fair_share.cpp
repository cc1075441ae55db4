#include "server/store/fair_share.h"

#include <algorithm>

namespace remesh {
namespace {

using std::chrono::microseconds;

constexpr microseconds kClaimCost = std::chrono::seconds(1);
constexpr microseconds kLongestRun = std::chrono::hours(24);

}  // namespace

std::optional<std::size_t> next_tenant(std::span<const TenantLoad> loads, std::int64_t level) {
    std::optional<std::size_t> best;
    const auto is_before = [level](const TenantLoad& a, const TenantLoad& b) {
        const std::int64_t share_a = a.running * b.weight;
        const std::int64_t share_b = b.running * a.weight;
        if (share_a != share_b) {
            return share_a < share_b;
        }
        const std::int64_t used_a = std::max(a.used, level);
        const std::int64_t used_b = std::max(b.used, level);
        return used_a != used_b ? used_a < used_b : a.tenant < b.tenant;
    };
    for (std::size_t i = 0; i < loads.size(); ++i) {
        const bool may_run = !loads[i].max_running || loads[i].running < *loads[i].max_running;
        if (may_run && (!best || is_before(loads[i], loads[*best]))) {
            best = i;
        }
    }
    return best;
}

std::int64_t charge_of_claim(int weight) {
    return kClaimCost.count() / weight;
}

std::int64_t charge_of_attempt(microseconds run_time, int weight) {
    return (std::clamp(run_time, kClaimCost, kLongestRun) - kClaimCost).count() / weight;
}

}  // namespace remesh
