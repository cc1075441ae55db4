#include "client/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace remesh::client {
namespace {

struct CodePoint {
    char32_t value = 0;
    std::size_t length = 0;  ///< Bytes; 0 when they aren't UTF-8.
};

CodePoint decode(std::string_view text) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned first = byte(0);
    if (first < 0x80) {
        return {first, 1};
    }
    const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : first >= 0xC2 ? 2 : 0;
    if (length == 0 || first > 0xF4 || text.size() < length) {
        return {};
    }
    char32_t value = first & (0x7FU >> length);
    for (std::size_t i = 1; i < length; ++i) {
        if ((byte(i) & 0xC0U) != 0x80U) {
            return {};
        }
        value = (value << 6) | (byte(i) & 0x3FU);
    }
    constexpr std::array<char32_t, 5> kSmallest{0, 0, 0x80, 0x800, 0x10000};
    const bool overlong = value < kSmallest[length];
    const bool surrogate = value >= 0xD800 && value <= 0xDFFF;
    return overlong || surrogate || value > 0x10FFFF ? CodePoint{} : CodePoint{value, length};
}

bool is_control(char32_t c) {
    const bool turns_direction = c == 0x061C || c == 0x200E || c == 0x200F ||
                                 (c >= 0x202A && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069);
    const bool breaks_line = c == 0x2028 || c == 0x2029;
    return c < 0x20 || (c >= 0x7F && c <= 0x9F) || turns_direction || breaks_line;
}

std::string without_prefix(const std::string& name, std::string_view prefix) {
    return name.starts_with(prefix) ? name.substr(prefix.size()) : name;
}

}  // namespace

std::string sanitised(std::string_view text) {
    std::string safe;
    safe.reserve(text.size());
    while (!text.empty()) {
        const CodePoint point = decode(text);
        if (point.value == '\n' || point.value == '\t') {
            safe += ' ';
        } else if (point.length == 0 || is_control(point.value)) {
            safe += '?';
        } else {
            safe += text.substr(0, point.length);
        }
        text.remove_prefix(std::max<std::size_t>(point.length, 1));
    }
    return safe;
}

std::size_t columns(std::string_view text) {
    return static_cast<std::size_t>(std::count_if(
        text.begin(), text.end(), [](unsigned char c) { return (c & 0xC0U) != 0x80U; }));
}

std::string with_thousands(std::int64_t number) {
    std::string text = std::to_string(number);
    const std::size_t digits_start = number < 0 ? 1 : 0;
    for (std::size_t i = text.size(); i > digits_start + 3;) {
        i -= 3;
        text.insert(i, 1, ',');
    }
    return text;
}

std::string bytes_word(std::int64_t bytes) {
    constexpr std::array kUnits{"kB", "MB", "GB", "TB"};
    if (bytes < 1000) {
        return fmt::format("{} B", bytes);
    }
    double value = static_cast<double>(bytes) / 1000.0;
    std::size_t unit = 0;
    while (value >= 999.95 && unit + 1 < kUnits.size()) {
        value /= 1000.0;
        ++unit;
    }
    return fmt::format("{:.1f} {}", value, kUnits.at(unit));
}

std::string duration_word(double seconds) {
    if (seconds < 59.95) {
        return fmt::format("{:.1f} s", seconds);
    }
    const auto whole = static_cast<std::int64_t>(std::lround(seconds));
    if (whole < 3600) {
        return fmt::format("{} min {} s", whole / 60, whole % 60);
    }
    return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

std::string number_word(double value) {
    return fmt::format("{:.4g}", value);
}

std::string state_word(v1::Job::State state) {
    return without_prefix(v1::Job::State_Name(state), "STATE_");
}

std::string stage_word(v1::Stage stage) {
    return stage == v1::STAGE_UNSPECIFIED
               ? "starting"
               : lower_case(without_prefix(v1::Stage_Name(stage), "STAGE_"));
}

std::string format_word(v1::Format format) {
    return lower_case(without_prefix(v1::Format_Name(format), "FORMAT_"));
}

std::string kind_word(v1::Output::Kind kind) {
    return lower_case(without_prefix(v1::Output::Kind_Name(kind), "KIND_"));
}

std::string lower_case(std::string_view text) {
    std::string lower(text);
    std::transform(lower.begin(), lower.end(), lower.begin(), [](char c) {
        return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    });
    return lower;
}

std::string aligned(const std::vector<std::vector<std::string>>& rows) {
    std::vector<std::size_t> widths;
    for (const auto& row : rows) {
        widths.resize(std::max(widths.size(), row.size()));
        for (std::size_t i = 0; i < row.size(); ++i) {
            widths[i] = std::max(widths[i], columns(row[i]));
        }
    }
    std::string text;
    for (const auto& row : rows) {
        std::string line;
        for (std::size_t i = 0; i < row.size(); ++i) {
            const std::string padding(widths[i] - columns(row[i]), ' ');
            line.append(i == 0 ? "" : "  ");
            line.append(i == 0 ? row[i] : padding).append(i == 0 ? padding : row[i]);
        }
        line.erase(line.find_last_not_of(' ') + 1);
        text += line + '\n';
    }
    return text;
}

}  // namespace remesh::client
