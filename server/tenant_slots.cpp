#include "server/tenant_slots.h"

#include "server/convert.h"

namespace remesh {

std::shared_ptr<void> TenantSlots::take(const std::string& tenant) {
    const std::scoped_lock lock(mutex_);
    const auto found = of_tenant_.find(tenant);
    const int held = found == of_tenant_.end() ? 0 : found->second;
    if (held >= max_of_tenant_) {
        throw StatusError(too_many_status(
            "tenants/" + tenant + "/" + what_,
            "a tenant has at most " + std::to_string(max_of_tenant_) + " " + what_ + " at a time"));
    }
    if (taken_ >= max_) {
        throw StatusError(too_many_status(
            what_,
            "the server takes at most " + std::to_string(max_) + " " + what_ + " at a time"));
    }
    ++of_tenant_[tenant];
    ++taken_;
    return {nullptr, [this, tenant](void*) { give_back(tenant); }};
}

int TenantSlots::taken() const {
    const std::scoped_lock lock(mutex_);
    return taken_;
}

void TenantSlots::give_back(const std::string& tenant) {
    const std::scoped_lock lock(mutex_);
    const auto found = of_tenant_.find(tenant);
    if (--found->second == 0) {
        of_tenant_.erase(found);
    }
    --taken_;
}

}  // namespace remesh
