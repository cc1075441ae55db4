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

/// About four digits as people write them; an en dash for what isn't finite.
[[nodiscard]] std::string number(double value);

/// A measure in [0, 1] with three decimals.
[[nodiscard]] std::string ratio(double value);

/// A power of ten: "10⁻³".
[[nodiscard]] std::string power_of_ten(int exponent);

/// "1,234,567".
[[nodiscard]] std::string count(std::int64_t value);

/// A histogram as SVG, its bars scaled so that `top` (a share of all) is full height.
/// \param style  class of the bars
/// \param width  of the picture, in units of which its height is about 140
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

/// How values become heights.
enum class Scale {
    Linear,       ///< From 0.
    Logarithmic,  ///< Between powers of ten.
    Quality,      ///< From a round number below the worst to 1.
};

/// Curves as SVG, from the first iteration at which one of them has a value.
[[nodiscard]] std::string curves_svg(std::span<const ConvergenceSample> samples,
                                     std::span<const Curve> curves, Scale scale);

}  // namespace remesh::report
