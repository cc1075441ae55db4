#pragma once

#include <memory>
#include <string>
#include <string_view>

struct evp_md_ctx_st;

namespace remesh {

/// SHA-256 of bytes that come in pieces.
class Sha256 {
public:
    Sha256();

    void add(std::string_view bytes);
    /// 64 lower-case hexadecimal digits. To be called once.
    [[nodiscard]] std::string finish();

private:
    struct Free {
        void operator()(evp_md_ctx_st* context) const;
    };
    std::unique_ptr<evp_md_ctx_st, Free> context_;
};

[[nodiscard]] std::string sha256_of(std::string_view bytes);

/// Whether it is 64 lower-case hexadecimal digits.
[[nodiscard]] bool is_sha256(std::string_view text);

/// `bytes` random bytes from the operating system in hexadecimal.
[[nodiscard]] std::string random_hex(int bytes);

}  // namespace remesh
