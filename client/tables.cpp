#include "client/tables.h"

#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>

#include "client/json.h"
#include "client/results.h"
#include "client/text.h"

namespace remesh::client {
namespace {

using google::protobuf::util::TimeUtil;
using Rows = std::vector<std::vector<std::string>>;

std::string ratio(double value) {
    return fmt::format("{:.3f}", value);
}
std::string degrees(double value) {
    return fmt::format("{:.1f}", value);
}
std::string percent(double share) {
    return fmt::format("{:.0f} %", 100.0 * share);
}

bool was_open(const v1::Quality& quality) {
    return std::any_of(quality.defects().begin(), quality.defects().end(),
                       [](const v1::Defect& defect) { return defect.code() == "OPEN_BOUNDARY"; });
}

void add_surface_rows(Rows& rows, const v1::Quality& quality) {
    const auto& before = quality.before();
    const auto& after = quality.after();
    const auto row = [&](const std::string& title, auto value) {
        rows.push_back({title, value(before), value(after)});
    };
    using Surface = v1::SurfaceQuality;
    row("triangles", [](const Surface& s) { return with_thousands(s.triangles()); });
    row("  radius ratio, mean", [](const Surface& s) { return ratio(s.radius_ratio().mean()); });
    row("  radius ratio, 1 %",
        [](const Surface& s) { return ratio(s.radius_ratio().first_percentile()); });
    row("  smallest angle, degrees", [](const Surface& s) { return degrees(s.min_angle().min()); });
    row("components", [](const Surface& s) { return with_thousands(s.components()); });
    row("area", [](const Surface& s) { return number_word(s.area()); });
    rows.push_back({"enclosed volume", was_open(quality) ? "open" : number_word(before.volume()),
                    number_word(after.volume())});
}

void add_tet_rows(Rows& rows, const v1::TetQuality& tets) {
    rows.push_back({"tetrahedra", "-", with_thousands(tets.tets())});
    rows.push_back({"  radius ratio, mean", "-", ratio(tets.radius_ratio().mean())});
    rows.push_back({"  radius ratio, 1 %", "-", ratio(tets.radius_ratio().first_percentile())});
    rows.push_back({"  smallest dihedral, degrees", "-", degrees(tets.dihedral().min())});
}

std::string deviation_lines(const v1::Quality& quality) {
    const double h = quality.edge_length();
    if (h <= 0.0) {
        return {};
    }
    const auto line = [&](const std::string& title, const v1::Deviation& deviation) {
        return fmt::format("{:<27} p99 {:.3f} h, largest {:.3f} h\n", title, deviation.p99() / h,
                           deviation.max() / h);
    };
    return line("deviation, result to input", quality.output_to_input()) +
           line("deviation, input to result", quality.input_to_output()) +
           fmt::format("{:<27} {:+.2f} %\n", "volume change", 100.0 * quality.volume_change());
}

std::string defect_lines(const v1::Quality& quality) {
    std::string text;
    for (const v1::Defect& defect : quality.defects()) {
        text += fmt::format(
            "  {}\n",
            sanitised(defect.description().empty() ? defect.code() : defect.description()));
    }
    return text.empty() ? "no defects found in the input\n"
                        : "found in the input, and what was done:\n" + text;
}

/// "edge_length=1.2 relaxation.mass=2": what was asked for; the rest is the engine's choice.
void add_option_words(const nlohmann::ordered_json& options, const std::string& prefix,
                      std::vector<std::string>& words) {
    for (const auto& [key, value] : options.items()) {
        if (value.is_object()) {
            add_option_words(value, prefix + key + ".", words);
        } else if (value != "UNSPECIFIED") {
            words.push_back(fmt::format("{}{}={}", prefix, key, value.dump()));
        }
    }
}

std::string time_word(const google::protobuf::Timestamp& time) {
    google::protobuf::Timestamp whole = time;
    whole.set_nanos(0);
    return TimeUtil::ToString(whole);
}

std::string progress_word(const v1::Job& job) {
    switch (job.state()) {
        case v1::Job::STATE_QUEUED: return fmt::format("{} ahead", job.queue_position());
        case v1::Job::STATE_RUNNING:
        case v1::Job::STATE_CANCELLING:
            return fmt::format("{} {}", percent(job.progress().fraction()),
                               stage_word(job.progress().stage()));
        default: return job.has_end_time() ? duration_word(run_seconds(job)) : "";
    }
}

}  // namespace

double run_seconds(const v1::Job& job) {
    if (!job.has_start_time() || !job.has_end_time()) {
        return 0.0;
    }
    const auto span = job.end_time() - job.start_time();
    return static_cast<double>(TimeUtil::DurationToMilliseconds(span)) / 1e3;
}

std::string quality_table(const v1::Quality& quality) {
    Rows rows{{"", "before", "after"}};
    add_surface_rows(rows, quality);
    if (quality.has_tets()) {
        add_tet_rows(rows, quality.tets());
    }
    return aligned(rows) + deviation_lines(quality) + defect_lines(quality);
}

std::string jobs_table(const std::vector<v1::Job>& jobs) {
    std::string text;
    std::size_t widest = 4;
    for (const v1::Job& job : jobs) {
        widest = std::max(widest, columns(sanitised(job.name())));
    }
    text += fmt::format("{:<{}}  {:<11}  {:<20}  {:<16}  {}\n", "NAME", widest, "STATE", "CREATED",
                        "PROGRESS", "FILE");
    for (const v1::Job& job : jobs) {
        text += fmt::format("{:<{}}  {:<11}  {:<20}  {:<16}  {}\n", sanitised(job.name()), widest,
                            state_word(job.state()), time_word(job.create_time()),
                            progress_word(job), sanitised(job.spec().input().file_name()));
    }
    return text;
}

std::string job_card(const v1::Job& job) {
    const v1::Input& input = job.spec().input();
    std::string text = fmt::format("{}\n", sanitised(job.name()));
    const auto line = [&](const std::string& title, const std::string& value) {
        if (!value.empty()) {
            text += fmt::format("  {:<10} {}\n", title, value);
        }
    };
    line("state", fmt::format("{}  {}", state_word(job.state()), progress_word(job)));
    line("input", fmt::format("{} ({})", sanitised(input.file_name()),
                              bytes_word(input.digest().size_bytes())));
    std::vector<std::string> options;
    add_option_words(to_json(job.spec().options()), "", options);
    line("options", fmt::format("{}", fmt::join(options, " ")));
    for (const auto& [key, value] : job.spec().labels()) {
        line("label", sanitised(key + "=" + value));
    }
    line("created", time_word(job.create_time()));
    if (job.state() == v1::Job::STATE_QUEUED && job.has_estimated_start_time()) {
        line("starts", "about " + time_word(job.estimated_start_time()));
    }
    line("attempt",
         job.attempt() > 0 ? fmt::format("{} of {}", job.attempt(), job.max_attempts()) : "");
    if (job.has_failure()) {
        line("failure",
             fmt::format("{} in {}: {}", sanitised(job.failure().reason()),
                         stage_word(job.failure().stage()), sanitised(job.failure().message())));
    }
    for (const v1::Output& output : outputs_of(job)) {
        line(job.has_failure() ? "draft" : "output",
             fmt::format("{:<12} {:<20} {}", kind_word(output.kind()),
                         sanitised(output.file_name()), bytes_word(output.digest().size_bytes())));
    }
    return job.result().has_quality() ? text + "\n" + quality_table(job.result().quality()) : text;
}

std::string estimate_card(const std::string& title, const v1::Estimate& estimate) {
    const double seconds = static_cast<double>(estimate.cpu_time().seconds()) +
                           1e-9 * static_cast<double>(estimate.cpu_time().nanos());
    const std::string tets = estimate.tets() > 0 ? with_thousands(estimate.tets()) + " tets, " : "";
    return fmt::format("{}: about {}{} triangles, {} of one processor, {} of memory\n", title, tets,
                       with_thousands(estimate.triangles()), duration_word(seconds),
                       bytes_word(estimate.memory_bytes()));
}

std::string batch_table(const std::vector<v1::Job>& jobs) {
    Rows rows{{"file", "state", "h", "triangles", "s mean", "tets", "q mean", "min dihedral",
               "p99 dev/h", "time"}};
    for (const v1::Job& job : jobs) {
        std::vector<std::string> row{sanitised(job.spec().input().file_name()),
                                     state_word(job.state())};
        if (job.has_result()) {
            const v1::Quality& q = job.result().quality();
            const bool has_tets = q.has_tets();
            const double p99 = std::max(q.output_to_input().p99(), q.input_to_output().p99());
            row.insert(row.end(),
                       {number_word(q.edge_length()), with_thousands(q.after().triangles()),
                        ratio(q.after().radius_ratio().mean()),
                        has_tets ? with_thousands(q.tets().tets()) : "-",
                        has_tets ? ratio(q.tets().radius_ratio().mean()) : "-",
                        has_tets ? degrees(q.tets().dihedral().min()) : "-",
                        q.edge_length() > 0 ? ratio(p99 / q.edge_length()) : "-",
                        duration_word(run_seconds(job))});
        }
        rows.push_back(std::move(row));
    }
    return aligned(rows);
}

std::string inspection_card(const std::string& title, const v1::Inspection& inspection) {
    std::string text = title + "\n";
    const auto line = [&](const std::string& key, const std::string& value) {
        text += fmt::format("  {:<12} {}\n", key, value);
    };
    line("format", format_word(inspection.format()));
    line("triangles", with_thousands(inspection.triangles()));
    line("vertices", with_thousands(inspection.vertices()));
    line("parts", with_thousands(inspection.components()));
    if (inspection.patches() > 0) {
        line("patches", with_thousands(inspection.patches()));
    }
    if (inspection.box_min_size() == 3 && inspection.box_max_size() == 3) {
        std::vector<std::string> sides;
        for (int axis = 0; axis < 3; ++axis) {
            sides.push_back(number_word(inspection.box_max(axis) - inspection.box_min(axis)));
        }
        const v1::Unit unit = inspection.likely_unit();
        line("size", fmt::format("{}{}", fmt::join(sides, " x "),
                                 unit == v1::UNIT_MILLIMETER ? ", likely mm"
                                 : unit == v1::UNIT_METER    ? ", likely m"
                                                             : ""));
    }
    line("edges", number_word(inspection.mean_edge_length()) + " on average");
    line("suggested h", number_word(inspection.suggested_edge_length()));
    const std::vector<std::pair<std::int64_t, const char*>> damage{
        {inspection.boundary_loops(), "holes"},
        {inspection.boundary_edges(), "open edges"},
        {inspection.non_manifold_edges(), "edges with three and more triangles"},
        {inspection.inconsistent_edges(), "edges between triangles that face opposite ways"},
        {inspection.duplicate_triangles(), "repeated triangles"},
        {inspection.degenerate_triangles(), "triangles without area"}};
    bool is_sound = true;
    for (const auto& [count, what] : damage) {
        if (count > 0) {
            line(is_sound ? "damage" : "", with_thousands(count) + " " + what);
            is_sound = false;
        }
    }
    if (is_sound) {
        line("damage", "none found");
    }
    for (const std::string& warning : inspection.warnings()) {
        line("warning", sanitised(warning));
    }
    return text;
}

std::string capabilities_card(const v1::GetCapabilitiesResponse& server) {
    std::string text = fmt::format(
        "remeshd {}, API {}\n{} worker(s) with {} thread(s) each, at most {} jobs waiting, files "
        "up to {}\n\n",
        sanitised(server.server_version()), sanitised(server.api_version()), server.workers(),
        server.threads_per_job(), server.max_queued_jobs(),
        bytes_word(server.max_artifact_bytes()));
    Rows rows{{"format", "extension", "reads", "writes surface", "writes tets"}};
    const auto yes = [](bool x) { return std::string(x ? "yes" : "-"); };
    for (const v1::FormatCapability& format : server.formats()) {
        rows.push_back({format_word(format.format()), sanitised(format.extension()),
                        yes(format.can_read()), yes(format.can_write_surface()),
                        yes(format.can_write_tetrahedra())});
    }
    return text + aligned(rows) +
           "\ndefaults: " + to_json(server.default_options()).dump(2, ' ', true) + "\n";
}

}  // namespace remesh::client
