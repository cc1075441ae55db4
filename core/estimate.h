#pragma once

#include <cstdint>

#include "core/mesh/mesh.h"
#include "core/pipeline.h"

namespace remesh {

/// What a run is likely to need. Fitted to measured runs; right within a factor of two on closed
/// bodies without thin parts, and no more than a guess on surfaces with large holes.
struct RunEstimate {
    std::int64_t triangles = 0;  ///< Of the surface.
    std::int64_t tets = 0;       ///< 0 for the surface alone.
    double cpu_seconds = 0.0;
    std::int64_t memory_bytes = 0;  ///< Peak of the process.
};

/// Estimates from volume, area, edge length and size image alone; takes a small part of the run's
/// time.
/// \throws Error{InvalidInput} if nothing with area is there, or a size image lies elsewhere
RunEstimate estimate_run(const SurfaceMesh& input, const RemeshOptions& options);

}  // namespace remesh
