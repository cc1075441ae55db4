#pragma once

#include <algorithm>
#include <cstdint>

#include "core/mesh/mesh.h"

namespace remesh {

/// Scrambles a number: neighbouring inputs give unrelated outputs (splitmix64's finalizer).
[[nodiscard]] constexpr std::uint64_t hash_bits(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15ULL;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
}

/// Random number in [0, 1) that depends on its arguments only, so the same on any thread.
[[nodiscard]] constexpr double hash_random(std::uint64_t seed, std::uint64_t index,
                                           std::uint64_t draw) {
    const std::uint64_t bits = hash_bits(hash_bits(seed ^ hash_bits(index)) ^ draw);
    return static_cast<double>(bits >> 11) * 0x1.0p-53;
}

/// Place along a Z-order curve through a box: points close in number are close in space.
[[nodiscard]] inline std::uint64_t morton_code(const Vec3& point, const Box& box) {
    const double size = std::max((box.high - box.low).maxCoeff(), 1e-300);
    constexpr double kCells = 2097151.0;  // 21 bits an axis.
    const auto spread = [&](Eigen::Index axis) {
        const double at = (point[axis] - box.low[axis]) / size * kCells;
        auto x = static_cast<std::uint64_t>(std::clamp(at, 0.0, kCells));
        x = (x | (x << 32)) & 0x1f00000000ffffULL;
        x = (x | (x << 16)) & 0x1f0000ff0000ffULL;
        x = (x | (x << 8)) & 0x100f00f00f00f00fULL;
        x = (x | (x << 4)) & 0x10c30c30c30c30c3ULL;
        return (x | (x << 2)) & 0x1249249249249249ULL;
    };
    return spread(0) | (spread(1) << 1) | (spread(2) << 2);
}

}  // namespace remesh
