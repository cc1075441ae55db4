#include "server/tenant_slots.h"

#include "server/convert.h"

namespace remesh {

std::shared_ptr<void> TenantSlots::take(const std::string& tenant, std::int64_t count) {
    const std::scoped_lock lock(mutex_);
    require_any(tenant);
    return give(tenant, count);
}

std::shared_ptr<void> TenantSlots::hold(const std::string& tenant, std::int64_t count) {
    const std::scoped_lock lock(mutex_);
    return give(tenant, count);
}

void TenantSlots::require_room(const std::string& tenant) const {
    const std::scoped_lock lock(mutex_);
    require_any(tenant);
}

std::int64_t TenantSlots::taken() const {
    const std::scoped_lock lock(mutex_);
    return taken_;
}

void TenantSlots::require_any(const std::string& tenant) const {
    const auto found = of_tenant_.find(tenant);
    const std::int64_t held = found == of_tenant_.end() ? 0 : found->second;
    if (held >= max_of_tenant_) {
        throw StatusError(too_many_now_status(
            "tenants/" + tenant + "/" + what_,
            "a tenant has at most " + std::to_string(max_of_tenant_) + " " + what_ + " at a time"));
    }
    if (taken_ >= max_) {
        throw StatusError(too_many_now_status(
            what_,
            "the server takes at most " + std::to_string(max_) + " " + what_ + " at a time"));
    }
}

std::shared_ptr<void> TenantSlots::give(const std::string& tenant, std::int64_t count) {
    of_tenant_[tenant] += count;
    taken_ += count;
    return {nullptr, [this, tenant, count](void*) { give_back(tenant, count); }};
}

void TenantSlots::give_back(const std::string& tenant, std::int64_t count) {
    const std::scoped_lock lock(mutex_);
    const auto found = of_tenant_.find(tenant);
    found->second -= count;
    if (found->second == 0) {
        of_tenant_.erase(found);
    }
    taken_ -= count;
}

}  // namespace remesh
