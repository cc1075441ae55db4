#include "core/stages/sizing/regions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <variant>

#include "core/geometry/bvh.h"

namespace remesh {
namespace {

constexpr double kLayerHeight = 0.85;  // Of a layer of elements over their edges.

// size + slope * distance from a shape, of which `Distance` tells
//   std::optional<double> within(const Vec3& point, double reach)   nothing if it isn't nearer
template <typename Distance>
class DistanceSource final : public SizingSource {
public:
    DistanceSource(Distance distance, double size, double slope)
        : distance_(std::move(distance)), size_(size), slope_(slope) {}

    [[nodiscard]] double least_within(const Vec3& center, double radius,
                                      double best) const override {
        if (!(best > size_)) {
            return best;
        }
        const auto distance = distance_.within(center, (best - size_) / slope_ + radius);
        return distance ? std::min(best, size_ + slope_ * std::max(0.0, *distance - radius)) : best;
    }
    [[nodiscard]] double least() const override { return size_; }
    [[nodiscard]] double gradation() const override { return slope_; }

private:
    Distance distance_;
    double size_;
    double slope_;
};

class SphereDistance {
public:
    explicit SphereDistance(const SizingSphere& sphere) : sphere_(sphere) {}

    [[nodiscard]] std::optional<double> within(const Vec3& point, double /*reach*/) const {
        return std::max(0.0, (point - sphere_.center).norm() - sphere_.radius);
    }

private:
    SizingSphere sphere_;
};

class CuboidDistance {
public:
    explicit CuboidDistance(const SizingBox& box) : box_(box) {}

    [[nodiscard]] std::optional<double> within(const Vec3& point, double /*reach*/) const {
        return (box_.low - point).cwiseMax(point - box_.high).cwiseMax(Vec3::Zero()).norm();
    }

private:
    SizingBox box_;
};

// Points and line segments are triangles that have lost a dimension.
class SegmentDistance {
public:
    explicit SegmentDistance(const Points& points, bool is_chain) {
        std::vector<Triangle> segments;
        const auto n = static_cast<Index>(points.size());
        for (Index i = 0; i + (is_chain ? 1 : 0) < n; ++i) {
            const Index j = is_chain ? i + 1 : i;
            segments.push_back({i, j, j});
        }
        tree_ = Bvh(points, segments);
    }

    [[nodiscard]] std::optional<double> within(const Vec3& point, double reach) const {
        const auto nearest = tree_.closest(point, reach * reach);
        return nearest ? std::optional(std::sqrt(nearest->distance2)) : std::nullopt;
    }

private:
    Bvh tree_;
};

class BoundaryDistance {
public:
    explicit BoundaryDistance(const Domain& domain) : domain_(domain) {}

    [[nodiscard]] std::optional<double> within(const Vec3& point, double reach) const {
        const auto nearest = domain_.closest_within(point, reach);
        return nearest ? std::optional(nearest->distance) : std::nullopt;
    }

private:
    const Domain& domain_;
};

template <typename Distance>
std::shared_ptr<const SizingSource> make_source(Distance distance, double size, double slope) {
    return std::make_shared<DistanceSource<Distance>>(std::move(distance), size, slope);
}

}  // namespace

double slope_of(double growth) {
    return (growth - 1.0) / kLayerHeight;
}

std::shared_ptr<const SizingSource> make_region(const SizingRegion& region, double gradation) {
    const double slope = region.growth ? slope_of(*region.growth) : gradation;
    const auto source = [&](auto distance) {
        return make_source(std::move(distance), region.size, slope);
    };
    if (const auto* sphere = std::get_if<SizingSphere>(&region.shape)) {
        return source(SphereDistance(*sphere));
    }
    if (const auto* box = std::get_if<SizingBox>(&region.shape)) {
        return source(CuboidDistance(*box));
    }
    if (const auto* line = std::get_if<SizingPolyline>(&region.shape)) {
        return source(SegmentDistance(line->points, true));
    }
    return source(SegmentDistance(std::get<SizingPoints>(region.shape).points, false));
}

std::shared_ptr<const SizingSource> make_layer(const Domain& domain, const BoundaryLayer& layer) {
    return make_source(BoundaryDistance(domain), layer.first_size, slope_of(layer.growth));
}

}  // namespace remesh
