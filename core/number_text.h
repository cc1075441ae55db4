#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <string>

namespace remesh {

/// A number with the digits that tell it from all others and no more, for messages about what was
/// asked for: "0.3", "1e-09", "nan".
[[nodiscard]] inline std::string number_text(double value) {
    if (std::isnan(value)) {
        return "nan";  // Whatever its sign.
    }
    std::array<char, 32> text;
    const auto end =
        std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general);
    return {text.data(), end.ptr};
}

}  // namespace remesh
