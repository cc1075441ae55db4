#include "core/estimate.h"

#include <algorithm>
#include <cmath>

#include "core/stages/clean.h"
#include "core/stages/sizing/image.h"

namespace remesh {
namespace {

// A regular tet with edge h has h^3 / (6 sqrt 2); the lattice packs a little denser.
constexpr double kTetsPerCube = 9.0;
// A regular triangle with edge h has sqrt(3) / 4 h^2.
constexpr double kTrianglesPerSquare = 2.31;

constexpr double kSecondsPerTet = 1.0e-5;
constexpr double kSecondsPerSurfaceTriangle = 1.0e-4;
constexpr double kSecondsPerShellTriangle = 1.2e-4;  // Where the surface alone is wanted.
constexpr double kSecondsPerInputTriangle = 3.0e-5;

constexpr double kBaseBytes = 32.0 * (1 << 20);
constexpr double kBytesPerTet = 170.0;
constexpr double kBytesPerSurfaceTriangle = 300.0;
constexpr double kBytesPerShellTriangle = 700.0;
constexpr double kBytesPerCoupledTet = 250.0;  // More, of sizes that diffuse on the particles.
constexpr double kBytesPerInputTriangle = 600.0;
constexpr double kBytesPerVoxel = 12.0;  // Of a size image, while it's read.
// Nobody has the memory for more, and it still fits a 64-bit number of bytes.
constexpr double kMostElements = 1.0e15;

struct Extent {
    double area = 0.0;
    double volume = 0.0;
};

Extent extent_of(const SurfaceMesh& mesh) {
    // As the run will do, without what is garbage: one such vertex may outweigh all others.
    const Box plausible = plausible_box(mesh.vertices);
    const auto is_plausible = [&](Index v) {
        return contains(plausible, mesh.vertices[static_cast<std::size_t>(v)]);
    };
    const Vec3 origin = 0.5 * (plausible.low + plausible.high);
    Extent extent;
    for (const auto& [a, b, c] : mesh.triangles) {
        if (!is_plausible(a) || !is_plausible(b) || !is_plausible(c)) {
            continue;
        }
        const Vec3 p = mesh.vertices[static_cast<std::size_t>(a)] - origin;
        const Vec3 q = mesh.vertices[static_cast<std::size_t>(b)] - origin;
        const Vec3 r = mesh.vertices[static_cast<std::size_t>(c)] - origin;
        extent.area += 0.5 * (q - p).cross(r - p).norm();
        extent.volume += p.dot(q.cross(r)) / 6.0;
    }
    extent.volume = std::abs(extent.volume);
    return extent;
}

/// Cubes of edge h a volume. Of what may make h vary only an image is looked at.
double density_of(const SurfaceMesh& input, const RemeshOptions& options, double h) {
    const SizingOptions& sizing = options.sizing;
    if (!sizing.image) {
        return 1.0 / (h * h * h);
    }
    require_overlap(*sizing.image, input);
    const double h_max = sizing.max_size.value_or(h);
    // Without an edge length nobody has yet checked which of the two is larger.
    const double h_min = std::min(min_size_of(sizing, h), h_max);
    return mean_density(*sizing.image, bounding_box(input.vertices), h_min, h_max);
}

}  // namespace

RunEstimate estimate_run(const SurfaceMesh& input, const RemeshOptions& options) {
    const double h = options.edge_length ? *options.edge_length : suggest_edge_length(input);
    const Extent extent = extent_of(input);
    const double voxels =
        options.sizing.image ? static_cast<double>(options.sizing.image->sizes.size()) : 0.0;
    const double input_triangles = static_cast<double>(input.triangles.size());
    const double density = density_of(input, options, h);
    const double triangles =
        std::min(kMostElements, kTrianglesPerSquare * extent.area * std::pow(density, 2.0 / 3.0));
    const double tets =
        std::min(kMostElements, kTetsPerCube * extent.volume * density + 2.0 * triangles);

    RunEstimate estimate;
    estimate.triangles = static_cast<std::int64_t>(triangles);
    double seconds = kSecondsPerInputTriangle * input_triangles;
    double bytes = kBaseBytes + kBytesPerInputTriangle * input_triangles + kBytesPerVoxel * voxels;
    if (options.tetrahedra) {
        estimate.tets = static_cast<std::int64_t>(tets);
        seconds += kSecondsPerTet * tets + kSecondsPerSurfaceTriangle * triangles;
        bytes += kBytesPerTet * tets + kBytesPerSurfaceTriangle * triangles;
        if (options.sizing.propagation == Propagation::Coupled) {
            bytes += kBytesPerCoupledTet * tets;
        }
    } else {
        seconds += kSecondsPerShellTriangle * triangles;
        bytes += kBytesPerShellTriangle * triangles;
    }
    estimate.cpu_seconds = seconds;
    estimate.memory_bytes = static_cast<std::int64_t>(bytes);
    return estimate;
}

}  // namespace remesh
