#include "server/report/charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace remesh::report {
namespace {

constexpr double kBarsHeight = 116.0;
constexpr double kBarsLeft = 32.0;  // Of the labels of shares.
constexpr double kBarsTop = 6.0;
constexpr double kNarrow = 240.0;  // Width with room for a few marks only.
constexpr double kCurvesWidth = 520.0;
constexpr double kCurvesHeight = 170.0;
constexpr double kLeft = 46.0;  // Of the vertical axis' labels.

std::string text(double x, double y, std::string_view anchor, std::string_view content) {
    return fmt::format(R"(<text x="{:.1f}" y="{:.1f}" text-anchor="{}">{}</text>)", x, y, anchor,
                       escaped(content));
}

/// Lines at round shares below the highest bar, with their labels.
std::string share_lines(double top, double width) {
    constexpr std::array<double, 5> kSteps{0.02, 0.05, 0.1, 0.2, 0.4};
    const auto found =
        std::find_if(kSteps.begin(), kSteps.end(), [&](double size) { return top / size < 3.2; });
    const double step = found == kSteps.end() ? kSteps.back() : *found;
    std::string svg;
    for (double share = step; share <= top; share += step) {
        const double y = kBarsHeight - (kBarsHeight - kBarsTop) * share / top;
        svg += fmt::format(
            R"(<line class="grid" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.1f}" y2="{2:.1f}"/>)",
            kBarsLeft, width, y);
        svg += text(kBarsLeft - 5.0, y + 3.5, "end", fmt::format("{:.0f} %", 100.0 * share));
    }
    return svg;
}

/// Between the marks of an axis of ratios or angles.
double mark_step(double range, double width) {
    if (range <= 1.0) {
        return 0.2;
    }
    return range <= 60.0 || width > 2.0 * kNarrow ? (range <= 60.0 ? 15.0 : 30.0) : 60.0;
}

/// Vertical positions of values.
class Axis {
public:
    Axis(std::span<const Curve> curves, Scale scale)
        : scale_(scale), is_log_(scale == Scale::Logarithmic) {
        for (const Curve& curve : curves) {
            for (const auto& value : curve.values) {
                if (value && is_shown(*value)) {
                    low_ = std::min(low_, mapped(*value));
                    high_ = std::max(high_, mapped(*value));
                }
            }
        }
        if (is_log_ && !is_empty()) {
            low_ = std::floor(low_);
            high_ = std::max(std::ceil(high_), low_ + 1.0);
        } else if (scale_ == Scale::Quality && !is_empty()) {
            low_ = std::clamp(std::floor((low_ - 0.02) * 10.0) / 10.0, 0.0, 0.9);
            high_ = 1.0;
        } else if (!is_empty()) {
            low_ = 0.0;
            step_ = round_step(std::max(high_, 1e-300) / 4.0);
            high_ = step_ * std::ceil(high_ / step_);
        }
    }

    [[nodiscard]] bool is_empty() const { return !std::isfinite(low_) || !std::isfinite(high_); }
    [[nodiscard]] bool is_shown(double value) const {
        return std::isfinite(value) && (!is_log_ || value > 0.0);
    }
    [[nodiscard]] double y_of(double value) const { return y_at(mapped(value)); }

    [[nodiscard]] std::string ticks() const {
        std::string svg;
        const double step =
            is_log_ ? std::max(1.0, std::ceil((high_ - low_) / 5.0)) : (high_ - low_) / 4.0;
        for (double at = low_; at <= high_ + 1e-9 * std::abs(high_); at += step) {
            svg += fmt::format(
                R"(<line class="grid" x1="{:.1f}" x2="{:.1f}" y1="{:.1f}" y2="{:.1f}"/>)", kLeft,
                kCurvesWidth, y_at(at), y_at(at));
            svg += text(kLeft - 6.0, y_at(at) + 3.5, "end",
                        is_log_ ? power_of_ten(static_cast<int>(std::lround(at))) : number(at));
        }
        return svg;
    }

private:
    [[nodiscard]] double mapped(double value) const { return is_log_ ? std::log10(value) : value; }
    [[nodiscard]] double y_at(double mapped_value) const {
        return 8.0 + (kCurvesHeight - 8.0) * (1.0 - (mapped_value - low_) / (high_ - low_));
    }

    /// The next larger of 1, 2 and 5 times a power of ten.
    static double round_step(double step) {
        const double power = std::pow(10.0, std::floor(std::log10(step)));
        const double digit = step / power;
        return power * (digit <= 1.0 ? 1.0 : digit <= 2.0 ? 2.0 : digit <= 5.0 ? 5.0 : 10.0);
    }

    Scale scale_;
    bool is_log_;
    double step_ = 1.0;  // Between ticks of a linear axis.
    double low_ = std::numeric_limits<double>::infinity();
    double high_ = -std::numeric_limits<double>::infinity();
};

}  // namespace

std::string escaped(std::string_view text) {
    std::string safe;
    for (const char c : text) {
        switch (c) {
            case '&': safe += "&amp;"; break;
            case '<': safe += "&lt;"; break;
            case '>': safe += "&gt;"; break;
            case '"': safe += "&quot;"; break;
            case '\'': safe += "&#39;"; break;
            default:
                // Control characters may not stand in a page at all.
                safe += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? ' ' : c;
        }
    }
    return safe;
}

std::string number(double value) {
    const double size = std::abs(value);
    if (!std::isfinite(value)) {
        return "–";
    }
    if (size >= 1000.0 && size < 1e9) {
        return count(std::llround(value));
    }
    if (size == 0.0 || (size >= 1e-3 && size < 1e9)) {
        return fmt::format("{:.4g}", value);
    }
    const int exponent = static_cast<int>(std::floor(std::log10(size)));
    return fmt::format("{:.3g} × {}", value / std::pow(10.0, exponent), power_of_ten(exponent));
}

std::string ratio(double value) {
    if (!std::isfinite(value)) {
        return "–";
    }
    return value > 0.0 && value < 5e-4 ? "&lt; 0.001" : fmt::format("{:.3f}", value);
}

std::string power_of_ten(int exponent) {
    static constexpr std::array<std::string_view, 10> kDigits{"⁰", "¹", "²", "³", "⁴",
                                                              "⁵", "⁶", "⁷", "⁸", "⁹"};
    if (exponent == 0 || exponent == 1) {
        return exponent == 0 ? "1" : "10";
    }
    std::string text = exponent < 0 ? "10⁻" : "10";
    for (const char digit : std::to_string(std::abs(exponent))) {
        text += kDigits[static_cast<std::size_t>(digit - '0')];
    }
    return text;
}

std::string count(std::int64_t value) {
    std::string digits = std::to_string(value);
    const std::ptrdiff_t sign = value < 0 ? 1 : 0;
    for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > sign; at -= 3) {
        digits.insert(static_cast<std::size_t>(at), ",");
    }
    return digits;
}

double tallest_bin(const Summary& summary) {
    std::int64_t total = 0;
    std::int64_t tallest = 0;
    for (const std::int64_t bin : summary.histogram.counts) {
        total += bin;
        tallest = std::max(tallest, bin);
    }
    return total > 0 ? static_cast<double>(tallest) / static_cast<double>(total) : 0.0;
}

std::string histogram_svg(const Summary& summary, double top, std::string_view style,
                          double width) {
    const auto& counts = summary.histogram.counts;
    const double low = summary.histogram.low;
    const double high = summary.histogram.high;
    const auto bins = static_cast<double>(std::max<std::size_t>(1, counts.size()));
    const double total =
        static_cast<double>(std::accumulate(counts.begin(), counts.end(), std::int64_t{0}));
    const double step = (width - kBarsLeft) / bins;
    const auto x_of = [&](double value) {
        return kBarsLeft + (width - kBarsLeft) * (value - low) / std::max(high - low, 1e-300);
    };
    std::string svg = fmt::format(
        R"(<svg viewBox="0 0 {:.0f} {:.0f}" role="img" aria-label="mean {}, smallest {}">)", width,
        kBarsHeight + 22.0, number(summary.mean), number(summary.min));
    svg += share_lines(top, width);
    for (std::size_t i = 0; i < counts.size(); ++i) {
        const auto at = static_cast<double>(i);
        const double share = total > 0.0 ? static_cast<double>(counts[i]) / total : 0.0;
        const double height = top > 0.0 ? (kBarsHeight - kBarsTop) * share / top : 0.0;
        const double bin = (high - low) / bins;
        svg += fmt::format(
            R"(<rect class="{}" x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}"><title>{} to {}: {}</title></rect>)",
            style, kBarsLeft + at * step + 0.75, kBarsHeight - height, step - 1.5, height,
            number(low + at * bin), number(low + (at + 1.0) * bin), count(counts[i]));
    }
    svg +=
        fmt::format(R"(<line class="axis" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.1f}" y2="{2:.1f}"/>)",
                    kBarsLeft, width, kBarsHeight + 0.5);
    svg +=
        fmt::format(R"(<line class="mean" x1="{0:.1f}" x2="{0:.1f}" y1="{1:.0f}" y2="{2:.1f}"/>)",
                    x_of(summary.mean), kBarsTop, kBarsHeight);
    const double mark = mark_step(high - low, width);
    for (double at = low; at <= high + 1e-9; at += mark) {
        const bool is_last = at + mark > high + 1e-9;
        svg += text(x_of(at), kBarsHeight + 15.0,
                    at == low ? "start"
                    : is_last ? "end"
                              : "middle",
                    number(at));
    }
    return svg + "</svg>";
}

std::string curves_svg(std::span<const ConvergenceSample> samples, std::span<const Curve> curves,
                       Scale scale) {
    const Axis axis(curves, scale);
    if (axis.is_empty() || samples.empty()) {
        return "<p>Nothing was measured.</p>";
    }
    const auto has_value = [&](std::size_t i) {
        return std::any_of(curves.begin(), curves.end(),
                           [&](const Curve& curve) { return curve.values[i].has_value(); });
    };
    std::size_t from = 0;
    while (from + 1 < samples.size() && !has_value(from)) {
        ++from;
    }
    std::string svg = fmt::format(R"(<svg viewBox="0 0 {:.0f} {:.0f}" role="img" aria-label=")",
                                  kCurvesWidth + 4.0, kCurvesHeight + 22.0);
    for (const Curve& curve : curves) {
        svg += escaped(curve.label) + " ";
    }
    svg += "over iterations\">" + axis.ticks();
    const double first = samples[from].iteration;
    const double last = std::max(first + 1.0, static_cast<double>(samples.back().iteration));
    for (const Curve& curve : curves) {
        std::string points;
        for (std::size_t i = from; i < samples.size(); ++i) {
            if (curve.values[i] && axis.is_shown(*curve.values[i])) {
                points += fmt::format("{:.1f},{:.1f} ",
                                      kLeft + (kCurvesWidth - kLeft) *
                                                  (samples[i].iteration - first) / (last - first),
                                      axis.y_of(*curve.values[i]));
            }
        }
        svg += fmt::format(R"(<polyline class="{}" points="{}"/>)", curve.style, points);
    }
    svg +=
        text(kLeft, kCurvesHeight + 18.0, "start", "iteration " + count(samples[from].iteration));
    svg += text(kCurvesWidth, kCurvesHeight + 18.0, "end", count(samples.back().iteration));
    return svg + "</svg>";
}

}  // namespace remesh::report
