#pragma once

#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/mesh/mesh.h"

namespace remesh {

/// A number of four digits, for messages.
[[nodiscard]] inline std::string text_of(double x) {
    std::array<char, 32> text;
    std::snprintf(text.data(), text.size(), "%.4g", x);
    return text.data();
}

/// A share in whole percent, for messages: "3 %".
[[nodiscard]] inline std::string percent(double share) {
    return std::to_string(std::lround(100.0 * share)) + " %";
}

/// A place, for messages.
[[nodiscard]] inline std::string text_of(const Vec3& x) {
    return "(" + text_of(x[0]) + ", " + text_of(x[1]) + ", " + text_of(x[2]) + ")";
}

}  // namespace remesh
