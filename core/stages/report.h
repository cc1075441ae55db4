#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/geometry/domain.h"
#include "core/mesh/mesh.h"
#include "core/run_context.h"
#include "core/stages/prepare.h"

namespace remesh {

/// Counts over equal bins of [low, high]; values outside fall into the first or last bin.
struct Histogram {
    double low = 0.0;
    double high = 1.0;
    std::vector<std::int64_t> counts{};
};

/// A distribution in a few numbers.
struct Summary {
    std::int64_t count = 0;
    double min = 0.0;
    double first_percentile = 0.0;
    double mean = 0.0;
    double max = 0.0;
    Histogram histogram{};
};

/// Quality of a surface: before (the input) and after.
struct SurfaceQuality {
    std::int64_t vertices = 0;
    std::int64_t triangles = 0;
    std::int64_t components = 0;  ///< Connected by edges.
    std::int64_t euler_characteristic = 0;
    double area = 0.0;       ///< Model units squared.
    double volume = 0.0;     ///< Enclosed, model units cubed.
    Summary radius_ratio{};  ///< s, 20 bins of [0, 1].
    Summary min_angle{};     ///< Smallest angle of each triangle, degrees, 12 bins of [0, 60].
    Summary edge_length{};   ///< Model units.
};

struct TetQuality {
    std::int64_t tets = 0;
    double volume = 0.0;        ///< Model units cubed.
    Summary radius_ratio{};     ///< q, 20 bins of [0, 1].
    Summary dihedral{};         ///< Smallest and largest of each tet, degrees, 36 bins of [0, 180].
    double min_dihedral = 0.0;  ///< Degrees.
};

/// Distances between two surfaces, sampled at vertices, edge midpoints and centroids, model units.
struct Deviation {
    double max = 0.0;
    double p99 = 0.0;
    double rms = 0.0;
};

struct WorstElement {
    double radius_ratio = 0.0;
    double min_dihedral = 0.0;  ///< Degrees.
    Vec3 at = Vec3::Zero();     ///< Centroid, model units.
};

/// One bound that was asked for.
struct BoundCheck {
    std::string name{};  ///< "min_dihedral" (degrees), "max_deviation" (model units) or
                         ///< "max_volume_change" (share of the volume before).
    double bound = 0.0;
    double value = 0.0;
    bool holds = false;
};

struct QualityReport {
    InputFacts input{};
    std::vector<Defect> defects{};
    double edge_length = 0.0;  ///< h asked for, model units.
    SurfaceQuality before{};   ///< The input, welded and oriented.
    SurfaceQuality after{};
    std::optional<TetQuality> tets{};
    Deviation output_to_input{};
    Deviation input_to_output{};
    double volume_change = 0.0;  ///< (after - before) / before.
    double area_change = 0.0;
    std::vector<WorstElement> worst{};       ///< At most 10, worst first.
    std::vector<BoundCheck> bounds{};        ///< Those asked for.
    std::optional<double> coarsened_from{};  ///< The edge length before max_tets raised it.
    struct StageCost {
        Stage stage = Stage::Read;
        double seconds = 0.0;   ///< CPU seconds of this process.
        double peak_mib = 0.0;  ///< Peak resident memory of the process when the stage ended.
    };
    std::vector<StageCost> costs{};
};

[[nodiscard]] SurfaceQuality measure_surface(const SurfaceMesh& surface);
[[nodiscard]] TetQuality measure_tets(const TetMesh& mesh);

/// Distance from samples of `from` (vertices, edge midpoints, centroids) to the surface `to`.
[[nodiscard]] Deviation measure_deviation(const SurfaceMesh& from, const SurfaceMesh& to,
                                          const RunContext& run);

/// The report as JSON, documented field by field in docs/report.md. Numbers that aren't finite
/// become null.
[[nodiscard]] std::string to_json(const QualityReport& report);

}  // namespace remesh
