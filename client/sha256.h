#pragma once

#include <memory>
#include <span>
#include <string>

struct evp_md_ctx_st;

namespace remesh::client {

/// SHA-256 of bytes that come piece by piece.
class Sha256 {
public:
    Sha256();
    void update(std::span<const char> bytes);
    /// 64 lower-case hexadecimal digits; ends the computation.
    [[nodiscard]] std::string finish();

private:
    std::unique_ptr<evp_md_ctx_st, void (*)(evp_md_ctx_st*)> context_;
};

}  // namespace remesh::client
