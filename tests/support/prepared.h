#pragma once

#include <cstdint>
#include <numbers>
#include <string>

#include "core/stages/prepare.h"
#include "tests/support/shapes.h"

namespace remesh::testing {

inline constexpr double kTorusVolume = 2.0 * std::numbers::pi * std::numbers::pi * 0.4 * 0.4;

inline SurfaceMesh some_torus() {
    return torus(1.0, 0.4, 60, 30);
}

inline PrepareResult prepare(const SurfaceMesh& mesh, double h,
                             const PrepareOptions& options = {}) {
    RunContext run;
    return prepare_surface(mesh, h, options, run);
}

/// Share of the domain's box that lies inside, times the box: counted on a grid.
inline double sampled_volume(const Domain& domain) {
    constexpr int kCells = 40;
    const Box box = domain.bounds();
    const Vec3 step = (box.high - box.low) / kCells;
    int inside = 0;
    for (int i = 0; i < kCells * kCells * kCells; ++i) {
        const Vec3 cell(i % kCells + 0.5, i / kCells % kCells + 0.5, i / (kCells * kCells) + 0.5);
        inside += domain.region_at(box.low + cell.cwiseProduct(step));
    }
    return inside * step.prod();
}

/// Count of a defect, by its code.
inline std::int64_t count_of(const PrepareResult& result, const std::string& code) {
    for (const auto& defect : result.defects) {
        if (defect.code == code) {
            return defect.count;
        }
    }
    return 0;
}

}  // namespace remesh::testing
