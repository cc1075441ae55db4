#include "server/report/charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace remesh::report {
namespace {

constexpr double kBarsHeight = 110.0;
constexpr double kCurvesWidth = 520.0;
constexpr double kCurvesHeight = 170.0;
constexpr double kLeft = 46.0;  // Of the vertical axis' labels.

std::string text(double x, double y, std::string_view anchor, std::string_view content) {
    return fmt::format(R"(<text x="{:.1f}" y="{:.1f}" text-anchor="{}">{}</text>)", x, y, anchor,
                       escaped(content));
}

/// Vertical positions of values.
class Axis {
public:
    Axis(std::span<const Curve> curves, bool is_log) : is_log_(is_log) {
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
                        is_log_ ? fmt::format("1e{:.0f}", at) : number(at));
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
    return std::isfinite(value) ? fmt::format("{:.4g}", value) : "–";
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
    double total = 0.0;
    for (const std::int64_t bin : counts) {
        total += static_cast<double>(bin);
    }
    std::string svg = fmt::format(
        R"(<svg viewBox="0 0 {:.0f} {:.0f}" role="img" aria-label="mean {}, smallest {}">)", width,
        kBarsHeight + 16.0, number(summary.mean), number(summary.min));
    const double step = width / static_cast<double>(std::max<std::size_t>(1, counts.size()));
    for (std::size_t i = 0; i < counts.size(); ++i) {
        const double share = total > 0.0 ? static_cast<double>(counts[i]) / total : 0.0;
        const double height = top > 0.0 ? kBarsHeight * share / top : 0.0;
        const double low = summary.histogram.low;
        const double bin = (summary.histogram.high - low) /
                           static_cast<double>(std::max<std::size_t>(1, counts.size()));
        svg += fmt::format(
            R"(<rect class="{}" x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}"><title>{} to {}: {}</title></rect>)",
            style, static_cast<double>(i) * step + 0.75, kBarsHeight - height, step - 1.5, height,
            number(low + static_cast<double>(i) * bin),
            number(low + static_cast<double>(i + 1) * bin), count(counts[i]));
    }
    svg += fmt::format(R"(<line class="axis" x1="0" x2="{0:.0f}" y1="{1:.1f}" y2="{1:.1f}"/>)",
                       width, kBarsHeight + 0.5);
    svg += text(0.0, kBarsHeight + 13.0, "start", number(summary.histogram.low));
    svg += text(width, kBarsHeight + 13.0, "end", number(summary.histogram.high));
    return svg + "</svg>";
}

std::string curves_svg(std::span<const ConvergenceSample> samples, std::span<const Curve> curves,
                       bool is_log) {
    const Axis axis(curves, is_log);
    if (axis.is_empty() || samples.empty()) {
        return "<p>Nothing was measured.</p>";
    }
    std::string svg = fmt::format(R"(<svg viewBox="0 0 {:.0f} {:.0f}" role="img" aria-label=")",
                                  kCurvesWidth + 4.0, kCurvesHeight + 22.0);
    for (const Curve& curve : curves) {
        svg += escaped(curve.label) + " ";
    }
    svg += "over iterations\">" + axis.ticks();
    const double last = std::max(1, samples.back().iteration);
    for (const Curve& curve : curves) {
        std::string points;
        for (std::size_t i = 0; i < samples.size(); ++i) {
            if (curve.values[i] && axis.is_shown(*curve.values[i])) {
                points += fmt::format("{:.1f},{:.1f} ",
                                      kLeft + (kCurvesWidth - kLeft) * samples[i].iteration / last,
                                      axis.y_of(*curve.values[i]));
            }
        }
        svg += fmt::format(R"(<polyline class="{}" points="{}"/>)", curve.style, points);
    }
    svg += text(kLeft, kCurvesHeight + 18.0, "start", "iteration 1");
    svg += text(kCurvesWidth, kCurvesHeight + 18.0, "end", count(samples.back().iteration));
    return svg + "</svg>";
}

}  // namespace remesh::report
