#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/run_context.h"
#include "core/stages/report.h"

namespace remesh::report {

/// Text as it may stand in HTML, between tags and in quoted attributes.
[[nodiscard]] std::string escaped(std::string_view text);

/// About four digits; an en dash for what isn't finite.
[[nodiscard]] std::string number(double value);

/// "1,234,567".
[[nodiscard]] std::string count(std::int64_t value);

/// A histogram as SVG, its bars scaled so that `top` (a share of all) is full height.
/// \param style  class of the bars
/// \param width  of the picture, in units of which its height is about 126
[[nodiscard]] std::string histogram_svg(const Summary& summary, double top, std::string_view style,
                                        double width);

/// Largest share of all that a bin holds.
[[nodiscard]] double tallest_bin(const Summary& summary);

/// One line of a chart over the iterations; what isn't there is left out.
struct Curve {
    std::string_view label{};
    std::string_view style{};
    std::vector<std::optional<double>> values{};
};

/// Curves as SVG. \param is_log  whether the vertical axis is logarithmic
[[nodiscard]] std::string curves_svg(std::span<const ConvergenceSample> samples,
                                     std::span<const Curve> curves, bool is_log);

}  // namespace remesh::report
