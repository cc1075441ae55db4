#pragma once

#include "core/mesh/mesh.h"

namespace remesh {

/// What asks for no less than this share of the size without it isn't worth a sample or a block.
inline constexpr double kWorthIt = 0.97;

/// Something that asks for a size in its place and for no more than `gradation()` times the
/// distance above that elsewhere: one of the maps whose minimum is the sizing field.
class SizingSource {
public:
    SizingSource() = default;
    SizingSource(const SizingSource&) = delete;
    SizingSource& operator=(const SizingSource&) = delete;
    virtual ~SizingSource() = default;

    /// The smaller of `best` and what the source asks for within `radius` of a point, that is at
    /// the point itself for radius 0. Model units. Safe from any thread.
    [[nodiscard]] virtual double least_within(const Vec3& center, double radius,
                                              double best) const = 0;
    [[nodiscard]] virtual double least() const = 0;      ///< Least size asked for anywhere.
    [[nodiscard]] virtual double gradation() const = 0;  ///< > 0.
};

}  // namespace remesh
