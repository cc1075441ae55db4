#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace remesh {

/// Where a page of a list ends, sealed: a job's number counts the jobs of all tenants, so nobody
/// may read it. Tokens are good for their tenant and for as long as this object lives.
class PageTokens {
public:
    PageTokens();

    [[nodiscard]] std::string seal(std::string_view tenant, std::int64_t number) const;
    /// Nothing if the token isn't one of the tenant's.
    [[nodiscard]] std::optional<std::int64_t> open(std::string_view tenant,
                                                   std::string_view token) const;

private:
    std::string secret_;
};

}  // namespace remesh
