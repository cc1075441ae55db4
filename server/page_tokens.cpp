#include "server/page_tokens.h"

#include <openssl/evp.h>

#include <array>
#include <cstring>
#include <memory>

#include "server/store/digest.h"
#include "server/store/job_store.h"

namespace remesh {
namespace {

using Block = std::array<unsigned char, 16>;

struct FreeContext {
    void operator()(EVP_CIPHER_CTX* context) const { EVP_CIPHER_CTX_free(context); }
};

/// AES of one block. Its key (of the digits as many as fit) is used for blocks of one kind only, of
/// which no two are alike.
Block cipher(const std::string& key, const Block& in, bool encrypts) {
    const std::unique_ptr<EVP_CIPHER_CTX, FreeContext> context(EVP_CIPHER_CTX_new());
    Block out{};
    int size = 0;
    if (!context ||
        EVP_CipherInit_ex(context.get(), EVP_aes_256_ecb(), nullptr,
                          reinterpret_cast<const unsigned char*>(key.data()), nullptr,
                          encrypts ? 1 : 0) != 1 ||
        EVP_CIPHER_CTX_set_padding(context.get(), 0) != 1 ||
        EVP_CipherUpdate(context.get(), out.data(), &size, in.data(),
                         static_cast<int>(in.size())) != 1) {
        throw StoreError("store: AES isn't available");
    }
    return out;
}

int digit_of(char c) {
    if (c >= '0' && c <= '9') {
        return c - '0';
    }
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

}  // namespace

std::string PageTokens::seal(std::string_view tenant, std::int64_t number) const {
    Block block{};  // The number, and zeros that show that it was us who sealed it.
    std::memcpy(block.data(), &number, sizeof number);
    constexpr std::string_view kDigits = "0123456789abcdef";
    std::string token;
    for (const unsigned char byte : cipher(sha256_of(key_ + std::string(tenant)), block, true)) {
        token += kDigits[byte >> 4U];
        token += kDigits[byte & 15U];
    }
    return token;
}

std::optional<std::int64_t> PageTokens::open(std::string_view tenant,
                                             std::string_view token) const {
    Block sealed{};
    if (token.size() != 2 * sealed.size()) {
        return std::nullopt;
    }
    for (std::size_t i = 0; i < sealed.size(); ++i) {
        const int high = digit_of(token[2 * i]);
        const int low = digit_of(token[2 * i + 1]);
        if (high < 0 || low < 0) {
            return std::nullopt;
        }
        sealed[i] = static_cast<unsigned char>(16 * high + low);
    }
    const Block block = cipher(sha256_of(key_ + std::string(tenant)), sealed, false);
    std::int64_t number = 0;
    Block expected{};
    std::memcpy(&number, block.data(), sizeof number);
    std::memcpy(expected.data(), &number, sizeof number);
    return block == expected ? std::optional(number) : std::nullopt;
}

}  // namespace remesh
