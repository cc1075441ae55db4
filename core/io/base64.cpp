#include "core/io/base64.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace remesh::io {
namespace {

constexpr std::string_view kAlphabet =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

constexpr std::uint8_t kPadding = 64;
constexpr std::uint8_t kSpace = 65;
constexpr std::uint8_t kInvalid = 66;

constexpr std::array<std::uint8_t, 256> make_values() {
    std::array<std::uint8_t, 256> values{};
    values.fill(kInvalid);
    for (std::size_t i = 0; i < kAlphabet.size(); ++i) {
        values[static_cast<unsigned char>(kAlphabet[i])] = static_cast<std::uint8_t>(i);
    }
    for (const char space : {' ', '\t', '\r', '\n'}) {
        values[static_cast<unsigned char>(space)] = kSpace;
    }
    values[static_cast<unsigned char>('=')] = kPadding;
    return values;
}

constexpr auto kValues = make_values();

std::uint32_t value_of(char c) {
    return kValues[static_cast<unsigned char>(c)];
}

void append_bits(std::uint32_t bits, std::size_t bytes, std::string& out) {
    for (std::size_t i = 0; i < bytes; ++i) {
        out.push_back(static_cast<char>((bits >> (16 - 8 * i)) & 0xFF));
    }
}

}  // namespace

std::string decode_base64(std::string_view text, std::size_t limit) {
    std::string out;
    out.reserve(std::min(limit, text.size() / 4 * 3 + 3) + 3);
    std::uint32_t bits = 0;
    std::size_t digits = 0;
    std::size_t i = 0;
    while (i < text.size() && out.size() < limit) {
        if (digits == 0 && i + 4 <= text.size()) {
            const std::uint32_t a = value_of(text[i]);
            const std::uint32_t b = value_of(text[i + 1]);
            const std::uint32_t c = value_of(text[i + 2]);
            const std::uint32_t d = value_of(text[i + 3]);
            if (std::max({a, b, c, d}) < kPadding) {
                append_bits((a << 18) | (b << 12) | (c << 6) | d, 3, out);
                i += 4;
                continue;
            }
        }
        const std::uint32_t value = value_of(text[i++]);
        if (value < kPadding) {
            bits = (bits << 6) | value;
            if (++digits == 4) {
                append_bits(bits, 3, out);
                bits = 0;
                digits = 0;
            }
        } else if (value == kPadding) {
            if (digits > 1) {
                append_bits(bits << (6 * (4 - digits)), digits - 1, out);
            }
            bits = 0;
            digits = 0;
        } else if (value == kInvalid) {
            break;
        }
    }
    if (digits > 1) {
        append_bits(bits << (6 * (4 - digits)), digits - 1, out);
    }
    if (out.size() > limit) {
        out.resize(limit);
    }
    return out;
}

void append_base64(std::string_view bytes, std::string& out) {
    const auto byte = [&](std::size_t i) {
        return i < bytes.size() ? std::uint32_t{static_cast<unsigned char>(bytes[i])} : 0U;
    };
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const std::uint32_t bits = (byte(i) << 16) | (byte(i + 1) << 8) | byte(i + 2);
        out.push_back(kAlphabet[bits >> 18]);
        out.push_back(kAlphabet[(bits >> 12) & 63]);
        out.push_back(i + 1 < bytes.size() ? kAlphabet[(bits >> 6) & 63] : '=');
        out.push_back(i + 2 < bytes.size() ? kAlphabet[bits & 63] : '=');
    }
}

}  // namespace remesh::io
