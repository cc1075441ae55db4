#include "server/report/page.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <functional>
#include <ostream>

#include "server/report/charts.h"
#include "server/report/picture.h"
#include "server/report/style.h"

namespace remesh::report {
namespace {

constexpr int kPictureHeight = 520;
// Widths of histograms: two beside each other take as much as one.
constexpr double kHalf = 240.0;
constexpr double kWhole = 500.0;

std::string base64(std::string_view bytes) {
    constexpr std::string_view kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t at = 0; at < bytes.size(); at += 3) {
        std::uint32_t word = 0;
        const std::size_t length = std::min<std::size_t>(3, bytes.size() - at);
        for (std::size_t i = 0; i < 3; ++i) {
            word = word << 8U | (i < length ? static_cast<unsigned char>(bytes[at + i]) : 0U);
        }
        for (std::size_t i = 0; i < 4; ++i) {
            text += i <= length ? kDigits[word >> (18U - 6U * i) & 63U] : '=';
        }
    }
    return text;
}

std::string picture(const Facets& facets, const View& view, std::string_view caption) {
    return fmt::format(
        R"(<figure><img alt="{0}" src="data:image/png;base64,{1}"/><figcaption>{0}</figcaption></figure>)",
        escaped(caption), base64(draw_png(facets, view, kPictureHeight)));
}

/// "2.5 mm²", or "2.5" if nobody said what the unit is.
std::string with_unit(double value, const JobRequest& request, std::string_view power = "") {
    return number(value) + (request.unit.empty() ? "" : " " + request.unit + std::string(power));
}

/// What coordinates and lengths mean.
std::string frame_of(const JobRequest& request) {
    const std::string lengths =
        request.unit.empty() ? "Lengths are in the unit of the file, which wasn't said"
                             : "Lengths are in " + request.unit + ", as was said of the file";
    const std::string axes =
        request.space == "LPS"
            ? "coordinates are LPS: x to the patient's left, y posterior, z superior"
        : request.space == "RAS"
            ? "coordinates are RAS: x to the patient's right, y anterior, z superior"
            : "coordinates are those of the file, whose space wasn't said";
    return lengths + "; " + axes + ".";
}

/// "OPEN_BOUNDARY" as "open boundary".
std::string in_words(std::string code) {
    std::transform(code.begin(), code.end(), code.begin(), [](char c) {
        return c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    });
    return code;
}

/// Whether the bounds that were asked for hold; a mesh that breaks one is only a draft.
void write_bounds(const QualityReport& report, std::ostream& out) {
    std::string kept;
    std::string broken;
    for (const BoundCheck& check : report.bounds) {
        std::string& list = check.holds ? kept : broken;
        list +=
            fmt::format("{}{} is {}, the bound is {}", list.empty() ? "" : "; ",
                        escaped(in_words(check.name)), number(check.value), number(check.bound));
    }
    if (!broken.empty()) {
        out << "<p class=\"broken\"><b>A draft: it doesn't keep what was asked for.</b> " << broken
            << ".</p>";
    }
    if (!kept.empty()) {
        out << "<p>Kept, as asked for: " << kept << ".</p>";
    }
}

/// The result in two sentences.
void write_verdict(const QualityReport& report, const JobRequest& request, std::ostream& out) {
    out << "<p class=\"verdict\">"
        << (report.tets ? count(report.tets->tets) + " tetrahedra"
                        : count(report.after.triangles) + " triangles")
        << " with edges of about " << with_unit(report.edge_length, request)
        << ". Checked exactly: closed, manifold, free of self-intersections"
        << (report.tets ? ", no inverted tetrahedron" : "") << ".</p><p class=\"hint\">"
        << frame_of(request) << "</p>";
    write_bounds(report, out);
}

void write_pictures(const PageContent& content, std::ostream& out) {
    const Facets before = facets_of(content.input);
    const View view = upright_view(before);
    out << "<section class=\"pictures\">"
        << picture(before, view,
                   "Before: " + count(content.result.report.input.triangles) + " triangles")
        << picture(facets_of(content.result.surface), view,
                   "After: " + count(content.result.report.after.triangles) + " triangles");
    if (content.result.report.tets) {
        out << picture(half_of(content.result.tets, view), view,
                       "Cut in half: " + count(content.result.report.tets->tets) + " tetrahedra");
    }
    out << "</section><p class=\"scale\"><span>0, degenerate</span><i></i><span>1, "
           "regular</span></p><p class=\"hint\">Every element is coloured by its radius ratio. All "
           "pictures are seen from the same side, the longest axis upright.</p>";
}

/// What a histogram shows. Radius ratios go to 1, angles beyond.
std::string shown(const Summary& summary, double value) {
    return summary.histogram.high <= 1.0 ? ratio(value) : number(value) + "°";
}

std::string labelled(const std::string& svg, std::string_view label, const Summary& summary) {
    return fmt::format("<div>{}<p><b>{}</b> mean {} · worst 1 % {} · worst {} · {}</p></div>", svg,
                       label, shown(summary, summary.mean),
                       shown(summary, summary.first_percentile), shown(summary, summary.min),
                       count(summary.count));
}

void write_pair(std::string_view title, std::string_view unit, const Summary& before,
                const Summary& after, std::ostream& out) {
    const double top = std::max(tallest_bin(before), tallest_bin(after));
    out << fmt::format(
        "<figure><h3>{} <small>{}</small></h3><div class=\"pair\">{}{}</div></figure>", title, unit,
        labelled(histogram_svg(before, top, "before", kHalf), "before", before),
        labelled(histogram_svg(after, top, "after", kHalf), "after", after));
}

void write_single(std::string_view title, std::string_view unit, const Summary& summary,
                  std::ostream& out) {
    out << fmt::format(
        "<figure><h3>{} <small>{}</small></h3><div class=\"pair\">{}</div></figure>", title, unit,
        labelled(histogram_svg(summary, tallest_bin(summary), "after", kWhole), "after", summary));
}

void write_histograms(const QualityReport& report, std::ostream& out) {
    out << "<h2>Quality before and after</h2><p class=\"hint\">Bars are shares of all elements, "
           "the "
           "dotted line is their mean.</p><section class=\"grid\">";
    write_pair("Triangles: radius ratio", "inscribed over circumscribed circle, 1 is equilateral",
               report.before.radius_ratio, report.after.radius_ratio, out);
    write_pair("Triangles: smallest angle", "degrees, 60 is the best there is",
               report.before.min_angle, report.after.min_angle, out);
    if (report.tets) {
        write_single("Tetrahedra: radius ratio",
                     "inscribed over circumscribed sphere, 1 is regular", report.tets->radius_ratio,
                     out);
        write_single("Tetrahedra: smallest and largest dihedral angle", "degrees, 70.5 is regular",
                     report.tets->dihedral, out);
    }
    out << "</section>";
}

using Pick = std::function<std::optional<double>(const ConvergenceSample&)>;

struct Line {
    std::string_view label;
    std::string_view style;
    Pick pick;
};

void write_chart(std::string_view title, std::string_view unit, const std::vector<Line>& lines,
                 Scale scale, std::span<const ConvergenceSample> samples, std::ostream& out) {
    std::vector<Curve> curves;
    std::string legend;
    for (const Line& line : lines) {
        Curve curve{line.label, line.style, {}};
        for (const ConvergenceSample& sample : samples) {
            curve.values.push_back(line.pick(sample));
        }
        curves.push_back(std::move(curve));
        legend += fmt::format("<span class=\"{}\"><i></i>{}</span>", line.style, line.label);
    }
    out << fmt::format("<figure><h3>{} <small>{}</small></h3><p class=\"legend\">{}</p>{}</figure>",
                       title, unit, legend, curves_svg(samples, curves, scale));
}

void write_convergence(std::span<const ConvergenceSample> samples, std::ostream& out) {
    using Sample = ConvergenceSample;
    out << "<h2>Convergence</h2><section class=\"grid\">";
    write_chart("Forces and steps", "what pulls at particles, how far they move; in edge lengths",
                {{"residual force", "first", [](const Sample& s) { return s.residual_force; }},
                 {"largest step", "second", [](const Sample& s) { return s.max_displacement; }},
                 {"rms step", "third", [](const Sample& s) { return s.rms_displacement; }}},
                Scale::Logarithmic, samples, out);
    write_chart("Energy", "stored in springs and in motion, mean of a particle",
                {{"potential", "first", [](const Sample& s) { return s.potential_energy; }},
                 {"kinetic", "second", [](const Sample& s) { return s.kinetic_energy; }}},
                Scale::Logarithmic, samples, out);
    const auto counted = [](std::int64_t value) {
        return value > 0 ? std::optional(static_cast<double>(value)) : std::nullopt;
    };
    write_chart("Particles", "points that become vertices",
                {{"all", "first", [=](const Sample& s) { return counted(s.particles); }},
                 {"on the surface", "second",
                  [=](const Sample& s) { return counted(s.surface_particles); }}},
                Scale::Linear, samples, out);
    write_chart("Mesh quality", "radius ratio of tetrahedra, after each pass",
                {{"mean", "first",
                  [](const Sample& s) {
                      return s.quality ? std::optional(s.quality->mean) : std::nullopt;
                  }},
                 {"worst 1 %", "second",
                  [](const Sample& s) {
                      return s.quality ? std::optional(s.quality->first_percentile) : std::nullopt;
                  }}},
                Scale::Quality, samples, out);
    out << "</section>";
}

void write_defects(const QualityReport& report, const JobRequest& request, std::ostream& out) {
    out << "<h2>Found and repaired</h2>";
    if (report.defects.empty()) {
        out << "<p>Nothing was wrong with the input.</p>";
        return;
    }
    out << "<table><thead><tr><th>What</th><th class=\"right\">How many</th><th>What was found and "
           "done</th><th>Where: x, y, z"
        << (request.unit.empty() ? "" : ", " + request.unit)
        << (request.space.empty() ? "" : ", " + request.space) << "</th></tr></thead><tbody>";
    for (const Defect& defect : report.defects) {
        const std::string at = defect.at
                                   ? fmt::format("{}, {}, {}", number(defect.at->x()),
                                                 number(defect.at->y()), number(defect.at->z()))
                                   : "";
        out << fmt::format("<tr><td>{}</td><td class=\"right\">{}</td><td>{}</td><td>{}</td></tr>",
                           escaped(in_words(defect.code)), count(defect.count),
                           escaped(defect.description), at);
    }
    out << "</tbody></table>";
}

void write_row(const std::string& name, const std::string& before, const std::string& after,
               std::string_view bound, std::ostream& out) {
    out << fmt::format(
        "<tr><th>{}</th><td class=\"right\">{}</td><td class=\"right\">{}</td>"
        "<td>{}</td></tr>",
        name, before, after, bound);
}

void write_surface_rows(const QualityReport& report, const JobRequest& request, std::ostream& out) {
    const SurfaceQuality& before = report.before;
    const SurfaceQuality& after = report.after;
    // What an open surface encloses is a matter of taste.
    const bool is_open =
        std::any_of(report.defects.begin(), report.defects.end(),
                    [](const Defect& defect) { return defect.code == "OPEN_BOUNDARY"; });
    write_row("Triangles", count(before.triangles), count(after.triangles), "", out);
    write_row("Vertices", count(before.vertices), count(after.vertices), "", out);
    write_row("Parts", count(before.components), count(after.components), "", out);
    write_row("Euler characteristic", count(before.euler_characteristic),
              count(after.euler_characteristic), "even: closed, checked exactly", out);
    write_row("Area", with_unit(before.area, request, "²"), with_unit(after.area, request, "²"), "",
              out);
    write_row("Enclosed volume", is_open ? "open" : with_unit(before.volume, request, "³"),
              with_unit(after.volume, request, "³"), "", out);
    write_row("Radius ratio of triangles, mean", ratio(before.radius_ratio.mean),
              ratio(after.radius_ratio.mean), "at most 1", out);
    write_row("Radius ratio of triangles, worst", ratio(before.radius_ratio.min),
              ratio(after.radius_ratio.min), "above 0", out);
    write_row("Angle of triangles, smallest, degrees", number(before.min_angle.min),
              number(after.min_angle.min), "at most 60", out);
    write_row("Edge length, mean", with_unit(before.edge_length.mean, request),
              with_unit(after.edge_length.mean, request), "about h", out);
}

void write_measures(const QualityReport& report, const JobRequest& request, std::ostream& out) {
    out << "<h2>Measures</h2><p class=\"hint\">Before is the "
           "input with equal positions merged and orientation repaired.</p><table><thead><tr>"
           "<th>Measure</th><th class=\"right\">Before</th><th class=\"right\">After</th>"
           "<th>Bound</th></tr></thead><tbody>";
    write_row("Edge length h, asked for or chosen", "", with_unit(report.edge_length, request), "",
              out);
    write_surface_rows(report, request, out);
    if (report.tets) {
        const TetQuality& tets = *report.tets;
        write_row("Tetrahedra", "", count(tets.tets), "none inverted, checked exactly", out);
        write_row("Volume of the tetrahedra", "", with_unit(tets.volume, request, "³"),
                  "the enclosed volume", out);
        write_row("Radius ratio of tetrahedra, mean", "", ratio(tets.radius_ratio.mean),
                  "at most 1", out);
        write_row("Radius ratio of tetrahedra, worst 1 %", "",
                  ratio(tets.radius_ratio.first_percentile), "", out);
        write_row("Radius ratio of tetrahedra, worst", "", ratio(tets.radius_ratio.min), "above 0",
                  out);
        write_row("Dihedral angle, smallest, degrees", "", number(tets.min_dihedral),
                  "at most 70.5", out);
        write_row("Dihedral angle, largest, degrees", "", number(tets.dihedral.max), "below 180",
                  out);
    }
    write_row("Change of volume", "", fmt::format("{:+.2f} %", 100.0 * report.volume_change), "",
              out);
    write_row("Change of area", "", fmt::format("{:+.2f} %", 100.0 * report.area_change), "", out);
    const auto distances = [&](const std::string& name, const Deviation& deviation) {
        const auto row = [&](const char* which, double value) {
            write_row(
                name + ", " + which, "",
                fmt::format("{} ({:.2f} h)", with_unit(value, request), value / report.edge_length),
                "", out);
        };
        row("root mean square", deviation.rms);
        row("99 % are nearer", deviation.p99);
        row("largest", deviation.max);
    };
    distances("Distance from result to input", report.output_to_input);
    distances("Distance from input to result", report.input_to_output);
    for (const BoundCheck& check : report.bounds) {
        write_row("Asked for: " + in_words(check.name), "", number(check.value),
                  fmt::format("{}, {}", number(check.bound), check.holds ? "kept" : "not kept"),
                  out);
    }
    out << "</tbody></table>";
}

void write_costs(const QualityReport& report, std::ostream& out) {
    out << "<h2>Cost</h2><table><thead><tr><th>Stage</th><th class=\"right\">CPU seconds</th><th "
           "class=\"right\">Peak memory of the process, MiB</th></tr></thead><tbody>";
    for (const QualityReport::StageCost& cost : report.costs) {
        out << fmt::format(
            "<tr><th>{}</th><td class=\"right\">{:.2f}</td><td "
            "class=\"right\">{:.0f}</td></tr>",
            stage_name(cost.stage), cost.seconds, cost.peak_mib);
    }
    out << "</tbody></table>";
}

void write_provenance(const PageContent& content, std::ostream& out) {
    out << "<h2>Provenance</h2><table><tbody>";
    const auto row = [&](std::string_view name, const std::string& value) {
        out << fmt::format("<tr><th>{}</th><td>{}</td></tr>", escaped(name), escaped(value));
    };
    row("Engine", "remesh " + content.engine_version);
    row("Made", fmt::format("{:%Y-%m-%d %H:%M:%S} UTC",
                            fmt::gmtime(std::chrono::system_clock::to_time_t(content.made))));
    row("Input", content.request.file_name);
    row("Input, SHA-256", content.request.input.sha256);
    row("Unit of the input", content.request.unit.empty() ? "not said" : content.request.unit);
    row("Space of the input", content.request.space.empty() ? "not said" : content.request.space);
    for (const JobOutput& file : content.files) {
        row(file.file_name + ", SHA-256", file.artifact.sha256);
    }
    if (!content.options.empty()) {
        out << "</tbody></table><h2>Options</h2><table><tbody>";
        for (const OptionRow& option : content.options) {
            row(option.name, option.value);
        }
    }
    out << "</tbody></table>";
}

}  // namespace

void write_page(const PageContent& content, std::ostream& out) {
    const std::string name =
        escaped(content.request.file_name.empty() ? "Surface" : content.request.file_name);
    out << "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><meta "
           "name=\"viewport\" content=\"width=device-width, initial-scale=1\"/><title>"
        << name << ", remeshed</title><style>" << kStyle << "</style></head><body><main><h1>"
        << name << "</h1><p class=\"hint\">Quality report by remesh " << content.engine_version
        << "</p>";
    write_verdict(content.result.report, content.request, out);
    write_pictures(content, out);
    write_defects(content.result.report, content.request, out);
    write_histograms(content.result.report, out);
    write_measures(content.result.report, content.request, out);
    write_convergence(content.samples, out);
    write_costs(content.result.report, out);
    write_provenance(content, out);
    out << "</main></body></html>\n";
}

}  // namespace remesh::report
