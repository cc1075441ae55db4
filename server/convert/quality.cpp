#include "server/convert.h"

namespace remesh {
namespace {

void write(const Summary& from, v1::Summary* to) {
    to->set_count(from.count);
    to->set_min(from.min);
    to->set_first_percentile(from.first_percentile);
    to->set_mean(from.mean);
    to->set_max(from.max);
    auto* histogram = to->mutable_histogram();
    histogram->set_low(from.histogram.low);
    histogram->set_high(from.histogram.high);
    histogram->mutable_counts()->Assign(from.histogram.counts.begin(), from.histogram.counts.end());
}

void write(const SurfaceQuality& from, v1::SurfaceQuality* to) {
    to->set_vertices(from.vertices);
    to->set_triangles(from.triangles);
    to->set_components(from.components);
    to->set_euler_characteristic(from.euler_characteristic);
    to->set_area(from.area);
    to->set_volume(from.volume);
    write(from.radius_ratio, to->mutable_radius_ratio());
    write(from.min_angle, to->mutable_min_angle());
    write(from.edge_length, to->mutable_edge_length());
}

void write(const TetQuality& from, v1::TetQuality* to) {
    to->set_tets(from.tets);
    to->set_volume(from.volume);
    write(from.radius_ratio, to->mutable_radius_ratio());
    write(from.dihedral, to->mutable_dihedral());
}

void write(const Deviation& from, v1::Deviation* to) {
    to->set_max(from.max);
    to->set_p99(from.p99);
    to->set_rms(from.rms);
}

}  // namespace

v1::Quality to_proto(const QualityReport& report) {
    v1::Quality quality;
    quality.set_edge_length(report.edge_length);
    write(report.before, quality.mutable_before());
    write(report.after, quality.mutable_after());
    if (report.tets) {
        write(*report.tets, quality.mutable_tets());
    }
    write(report.output_to_input, quality.mutable_output_to_input());
    write(report.input_to_output, quality.mutable_input_to_output());
    quality.set_volume_change(report.volume_change);
    for (const Defect& defect : report.defects) {
        auto* to = quality.add_defects();
        to->set_code(defect.code);
        to->set_description(defect.description);
        to->set_count(defect.count);
        if (defect.at) {
            to->mutable_at()->Assign(defect.at->begin(), defect.at->end());
        }
    }
    return quality;
}

}  // namespace remesh
