#pragma once

#include <memory>
#include <vector>

#include "core/geometry/sizing_field.h"
#include "core/geometry/sizing_source.h"

namespace remesh {

/// The largest field that honours every source: h(x) = max(h_min, min(h_max, min_i source_i(x))).
///
/// Nothing is interpolated, so it is exactly as Lipschitz as its steepest source.
class LipschitzField final : public SizingField {
public:
    /// \param h_min  lower clamp, > 0: sources that ask for less get this
    /// \param h_max  away from all sources, >= h_min
    LipschitzField(std::vector<std::shared_ptr<const SizingSource>> sources, double h_min,
                   double h_max);

    [[nodiscard]] double h(const Vec3& point) const override { return least_within(point, 0.0); }
    [[nodiscard]] double least_within(const Vec3& center, double radius) const override;
    /// h of the sources that have a place, where they ask for a size, at most about `radius` away;
    /// h_max() if none has.
    [[nodiscard]] double h_near_place(const Vec3& center, double radius) const;
    [[nodiscard]] double h_min() const override { return h_min_; }
    [[nodiscard]] double h_max() const override { return h_max_; }
    [[nodiscard]] double gradation() const override { return gradation_; }

private:
    std::vector<std::shared_ptr<const SizingSource>> sources_;
    double h_min_;
    double h_max_;
    double gradation_ = 0.0;
};

}  // namespace remesh
