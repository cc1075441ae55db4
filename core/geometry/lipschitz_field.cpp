#include "core/geometry/lipschitz_field.h"

#include <algorithm>
#include <utility>

namespace remesh {

LipschitzField::LipschitzField(std::vector<std::shared_ptr<const SizingSource>> sources,
                               double h_min, double h_max)
    : sources_(std::move(sources)), h_min_(h_max), h_max_(h_max) {
    for (const auto& source : sources_) {
        h_min_ = std::min(h_min_, std::max(h_min, source->least()));
        gradation_ = std::max(gradation_, source->gradation());
    }
}

double LipschitzField::least_within(const Vec3& center, double radius) const {
    double best = h_max_;
    for (const auto& source : sources_) {
        best = source->least_within(center, radius, best);
    }
    return std::max(best, h_min_);
}

// Outside of its places a source rises by its gradation, all the way.
double LipschitzField::h_near_place(const Vec3& center, double radius) const {
    constexpr double kAllTheWay = 0.75;  // Of the rise over twice the radius.
    double best = h_max_;
    for (const auto& source : sources_) {
        const double rise = 2.0 * radius * source->gradation();
        const double here = source->least_within(center, 0.0, best);
        if (here < best &&
            here - source->least_within(center, 2.0 * radius, here) < kAllTheWay * rise) {
            best = here;
        }
    }
    return std::max(best, h_min_);
}

}  // namespace remesh
