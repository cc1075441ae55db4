#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace remesh {

/// Where a page of a list ends, sealed: a job's number counts the jobs of all tenants, so nobody
/// may read it. Tokens are good for their tenant, and wherever the key is the same.
class PageTokens {
public:
    /// \param key  a secret
    explicit PageTokens(std::string key) : key_(std::move(key)) {}

    [[nodiscard]] std::string seal(std::string_view tenant, std::int64_t number) const;
    /// Nothing if the token isn't one of the tenant's.
    [[nodiscard]] std::optional<std::int64_t> open(std::string_view tenant,
                                                   std::string_view token) const;

private:
    std::string key_;
};

}  // namespace remesh
