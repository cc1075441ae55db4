#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace remesh {

/// Places for things that callers hold, of which no tenant can have all.
/// All calls may come from any thread.
class TenantSlots {
public:
    /// \param what  their name in the plural, for those who are turned away
    TenantSlots(std::string what, int max, int max_of_tenant)
        : what_(std::move(what)), max_(max), max_of_tenant_(max_of_tenant) {}

    /// Takes a place until the last copy of what is returned is gone; this must outlive it.
    /// \throws StatusError{RESOURCE_EXHAUSTED} if there is none to have
    [[nodiscard]] std::shared_ptr<void> take(const std::string& tenant);
    /// How many are taken.
    [[nodiscard]] int taken() const;

private:
    void give_back(const std::string& tenant);

    const std::string what_;
    const int max_;
    const int max_of_tenant_;
    mutable std::mutex mutex_;
    std::map<std::string, int> of_tenant_{};  // Without those that have none. Needs mutex_.
    int taken_ = 0;                           // needs mutex_
};

}  // namespace remesh
