#include "server/inspect.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/error.h"
#include "core/io/mesh_io.h"
#include "core/stages/clean.h"
#include "server/convert.h"

namespace remesh {
namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 30U;
constexpr std::int64_t kMaxTriangles = 20'000'000;

/// What a body of that size is most likely measured in: from a small bone to a whole human.
v1::Unit likely_unit(double diagonal) {
    if (diagonal >= 10.0 && diagonal <= 3'000.0) {
        return v1::UNIT_MILLIMETER;
    }
    if (diagonal >= 0.01 && diagonal <= 3.0) {
        return v1::UNIT_METER;
    }
    return v1::UNIT_UNSPECIFIED;
}

void write(const InputFacts& facts, v1::Inspection& to) {
    to.set_vertices(facts.vertices);
    to.set_triangles(facts.triangles);
    to.set_components(facts.components);
    to.mutable_box_min()->Assign(facts.bounds.low.begin(), facts.bounds.low.end());
    to.mutable_box_max()->Assign(facts.bounds.high.begin(), facts.bounds.high.end());
    to.set_likely_unit(likely_unit((facts.bounds.high - facts.bounds.low).norm()));
    to.set_area(facts.area);
    to.set_mean_edge_length(facts.mean_edge);
    to.set_boundary_edges(facts.boundary_edges);
    to.set_boundary_loops(facts.boundary_loops);
    to.set_non_manifold_edges(facts.non_manifold_edges);
    to.set_inconsistent_edges(facts.inconsistent_edges);
    to.set_duplicate_triangles(facts.duplicate_triangles);
    to.set_degenerate_triangles(facts.degenerate_triangles);
}

}  // namespace

v1::Inspection inspect_surface(std::string_view bytes, const std::string& hint) {
    if (bytes.size() > kMaxBytes) {
        throw Error(ErrorCode::TooLarge, "files of at most 1 GiB are inspected, this one has " +
                                             std::to_string(bytes.size()) + " bytes");
    }
    const ReadResult read = read_surface(bytes, hint, {.max_triangles = kMaxTriangles});
    const double edge_length = suggest_edge_length(read.mesh);
    RunContext run;
    const CleanResult clean = clean_surface(read.mesh, edge_length, run);

    v1::Inspection inspection;
    write(clean.facts, inspection);
    inspection.set_format(to_proto(read.format));
    inspection.set_suggested_edge_length(edge_length);
    const auto& patch = read.mesh.patch;
    inspection.set_patches(patch.empty() ? 0 : 1 + *std::max_element(patch.begin(), patch.end()));
    for (const std::string& warning : read.warnings) {
        inspection.add_warnings(warning);
    }
    return inspection;
}

}  // namespace remesh
