#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace remesh {

/// Places for things that callers hold, or bytes of them, of which no tenant can have all.
/// All calls may come from any thread.
class TenantSlots {
public:
    /// \param what  their name in the plural, for those who are turned away
    TenantSlots(std::string what, std::int64_t max, std::int64_t max_of_tenant)
        : what_(std::move(what)), max_(max), max_of_tenant_(max_of_tenant) {}

    /// Takes a place, or as many, until the last copy of what is returned is gone; this must
    /// outlive it. Whoever has any left may take more than that.
    /// \throws StatusError{RESOURCE_EXHAUSTED} if there is none to have
    [[nodiscard]] std::shared_ptr<void> take(const std::string& tenant, std::int64_t count = 1);
    /// Takes them whether there are any or not: of what is there already.
    [[nodiscard]] std::shared_ptr<void> hold(const std::string& tenant, std::int64_t count);
    /// \throws StatusError{RESOURCE_EXHAUSTED} if there is none to have
    void require_room(const std::string& tenant) const;
    /// How many are taken.
    [[nodiscard]] std::int64_t taken() const;

private:
    void require_any(const std::string& tenant) const;  // needs mutex_
    [[nodiscard]] std::shared_ptr<void> give(const std::string& tenant, std::int64_t count);
    void give_back(const std::string& tenant, std::int64_t count);

    const std::string what_;
    const std::int64_t max_;
    const std::int64_t max_of_tenant_;
    mutable std::mutex mutex_;
    std::map<std::string, std::int64_t>
        of_tenant_{};         // Without those that have none. Needs mutex_.
    std::int64_t taken_ = 0;  // needs mutex_
};

}  // namespace remesh
