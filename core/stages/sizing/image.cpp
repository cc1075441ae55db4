#include "core/stages/sizing/image.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/geometry/block_source.h"
#include "core/stages/text.h"

namespace remesh {
namespace {

constexpr double kSameShare = 0.03;  // Sizes that differ by less are as good as one.
constexpr double kFine = 0.25;       // Of a block over its size: what is finer isn't resolved.
constexpr double kMostParts = 16.0;  // Of a voxel along an axis.
constexpr std::size_t kMaxBlocks = 16'000'000;
constexpr double kFullCoverage = 0.99;
constexpr double kClearlyBetter = 0.1;  // Coverage in the other space over that in the assumed one.

using Voxel = Eigen::Array3i;

bool is_wish(float size) {
    return size > 0.0F && std::isfinite(size);
}

/// Turns an image's voxels into blocks, halving the lattice down to single voxels and joining them
/// again on the way up.
class BlockMaker {
public:
    BlockMaker(const SizeImage& image, double h_min, double h_max, RunContext& run)
        : image_(image),
          least_(static_cast<float>(h_min)),
          most_(static_cast<float>(kWorthIt * h_max)),
          run_(run) {}

    // \param low, high  voxels in [low, high)
    std::vector<SizingBlock> make(const Voxel& low, const Voxel& high) {
        if ((low < high).all()) {
            walk(low, high);
        }
        return std::move(blocks_);
    }

private:
    struct Extremes {
        float least = 0.0F;
        float most = 0.0F;
        bool is_full = false;  // Every voxel has a wish below most_.
    };

    [[nodiscard]] float size_at(const Voxel& voxel) const {
        const auto index = [&](int axis) { return static_cast<std::size_t>(voxel[axis]); };
        const auto nx = static_cast<std::size_t>(image_.size[0]);
        const auto ny = static_cast<std::size_t>(image_.size[1]);
        return image_.sizes[(index(2) * ny + index(1)) * nx + index(0)];
    }

    Extremes walk(const Voxel& low, const Voxel& high) {
        if (((high - low) == 1).all()) {
            return add_voxel(low);
        }
        int axis = 0;
        ((high - low).cast<double>() * image_.spacing.array()).maxCoeff(&axis);
        if (high[axis] - low[axis] < 2) {
            (high - low).maxCoeff(&axis);
        }
        const std::size_t before = blocks_.size();
        Voxel middle = high;
        middle[axis] = low[axis] + (high[axis] - low[axis]) / 2;
        const Extremes first = walk(low, middle);
        Voxel start = low;
        start[axis] = middle[axis];
        const Extremes second = walk(start, high);
        const Extremes both{std::min(first.least, second.least), std::max(first.most, second.most),
                            first.is_full && second.is_full};
        if (both.is_full) {
            join(low, high, both, before);
        }
        return both;
    }

    void join(const Voxel& low, const Voxel& high, const Extremes& sizes, std::size_t before) {
        const double longest = ((high - low).cast<double>() * image_.spacing.array()).maxCoeff();
        if (sizes.most <= (1.0F + static_cast<float>(kSameShare)) * sizes.least) {
            blocks_.resize(before);
            add(low.cast<double>() - 0.5, high.cast<double>() - 0.5,
                0.5F * (sizes.least + sizes.most));
        } else if (longest <= kFine * static_cast<double>(sizes.least)) {
            blocks_.resize(before);
            add(low.cast<double>() - 0.5, high.cast<double>() - 0.5, sizes.least);
        }
    }

    Extremes add_voxel(const Voxel& voxel) {
        if (++visited_ % (std::size_t{1} << 16U) == 0) {
            run_.checkpoint();
        }
        const float size = std::max(size_at(voxel), least_);
        if (!is_wish(size_at(voxel)) || size >= most_) {
            return {};
        }
        const Eigen::Array3d center = voxel.cast<double>();
        const Voxel parts = parts_of(voxel, size);
        if ((parts == 1).all()) {
            add(center - 0.5, center + 0.5, size);
            return {size, size, true};
        }
        const Eigen::Array3d step = 1.0 / parts.cast<double>();
        for (int k = 0; k < parts[2]; ++k) {
            for (int j = 0; j < parts[1]; ++j) {
                for (int i = 0; i < parts[0]; ++i) {
                    const Eigen::Array3d low = center - 0.5 + Eigen::Array3d(i, j, k) * step;
                    const float inside = std::max(interpolate(low + 0.5 * step), least_);
                    if (inside < most_) {
                        add(low, low + step, inside);
                    }
                }
            }
        }
        return {};
    }

    [[nodiscard]] Voxel clamped(const Voxel& voxel) const {
        return voxel.max(0).min(Voxel(image_.size[0], image_.size[1], image_.size[2]) - 1);
    }

    /// How often a voxel is divided along each axis, for parts that are as good as of one size.
    [[nodiscard]] Voxel parts_of(const Voxel& voxel, float size) const {
        Voxel parts = Voxel::Ones();
        for (int axis = 0; axis < 3; ++axis) {
            const double resolved =
                std::ceil(image_.spacing[axis] / (kFine * static_cast<double>(size)));
            if (resolved > 1.0) {
                const double change = static_cast<double>(change_along(voxel, axis) / size);
                parts[axis] = static_cast<int>(std::max(
                    1.0, std::min({resolved, std::ceil(change / kSameShare), kMostParts})));
            }
        }
        return parts;
    }

    /// Largest difference between neighbours along an axis, at a voxel and those around it.
    [[nodiscard]] float change_along(const Voxel& voxel, int axis) const {
        float change = 0.0F;
        for (int k = 0; k < 27; ++k) {
            Voxel offset(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
            if (offset[axis] == 1) {
                continue;
            }
            const float first = size_at(clamped(voxel + offset));
            ++offset[axis];
            const float second = size_at(clamped(voxel + offset));
            if (is_wish(first) && is_wish(second)) {
                change = std::max(change, std::abs(first - second));
            }
        }
        return change;
    }

    // Between the voxels around that have a wish; the nearest one has.
    [[nodiscard]] float interpolate(const Eigen::Array3d& point) const {
        const Voxel base = point.floor().cast<int>();
        const Eigen::Array3d share = point - base.cast<double>();
        double sum = 0.0;
        double weights = 0.0;
        for (int corner = 0; corner < 8; ++corner) {
            const Voxel step(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
            const float size = size_at(clamped(base + step));
            if (is_wish(size)) {
                const double weight = (step == 1).select(share, 1.0 - share).prod();
                sum += weight * static_cast<double>(size);
                weights += weight;
            }
        }
        return static_cast<float>(sum / weights);
    }

    void add(const Eigen::Array3d& low, const Eigen::Array3d& high, float size) {
        if (blocks_.size() >= kMaxBlocks) {
            throw Error(ErrorCode::TooLarge, "the size image changes in more than " +
                                                 std::to_string(kMaxBlocks) +
                                                 " places; resample it to larger voxels");
        }
        const Vec3 a = (low * image_.spacing.array()).matrix();
        const Vec3 b = (high * image_.spacing.array()).matrix();
        blocks_.push_back({a.cast<float>(), b.cast<float>(), size});
    }

    const SizeImage& image_;
    float least_;
    float most_;
    RunContext& run_;
    std::vector<SizingBlock> blocks_{};
    std::size_t visited_ = 0;
};

std::string span_of(const Box& box) {
    return text_of(box.low) + " to " + text_of(box.high);
}

bool overlap(const Box& a, const Box& b) {
    return (a.low.array() <= b.high.array()).all() && (b.low.array() <= a.high.array()).all();
}

/// As the surface would lie if it were in the other space.
Vec3 mirrored(const Vec3& point) {
    return {-point.x(), -point.y(), point.z()};
}

Box mirrored(const Box& box) {
    Box other;
    other.include(mirrored(box.low));
    other.include(mirrored(box.high));
    return other;
}

/// Share of the vertices that lie in a voxel.
template <typename Place>
double coverage(const SizeImage& image, const Points& vertices, Place place) {
    const auto covered = std::count_if(vertices.begin(), vertices.end(),
                                       [&](const Vec3& x) { return image.covers(place(x)); });
    return static_cast<double>(covered) /
           static_cast<double>(std::max<std::size_t>(1, vertices.size()));
}

std::string percent(double share) {
    return std::to_string(static_cast<int>(100.0 * share)) + " %";
}

void warn_of_coverage(const SizeImage& image, const Points& vertices, RunContext& run) {
    const double share = coverage(image, vertices, [](const Vec3& x) { return x; });
    if (share >= kFullCoverage) {
        return;
    }
    std::string message =
        "the size image covers " + percent(share) + " of the surface; it asks for nothing outside";
    const double other = coverage(image, vertices, [](const Vec3& x) { return mirrored(x); });
    if (image.assumes_space && other > share + kClearlyBetter) {
        message += "; were the surface in RAS, which its frame doesn't say, it would cover " +
                   percent(other);
    }
    run.warn({"SIZE_IMAGE_COVERAGE", message, std::nullopt});
}

/// Voxels that touch a box.
std::pair<Voxel, Voxel> voxels_in(const SizeImage& image, const Box& box) {
    Box local;
    for (unsigned corner = 0; corner < 8; ++corner) {
        local.include(image.local({(corner & 1U) != 0U ? box.high.x() : box.low.x(),
                                   (corner & 2U) != 0U ? box.high.y() : box.low.y(),
                                   (corner & 4U) != 0U ? box.high.z() : box.low.z()}));
    }
    const Eigen::Array3d size(image.size[0], image.size[1], image.size[2]);
    const auto voxel = [&](const Vec3& at, double offset) -> Voxel {
        const Eigen::Array3d index = (at.array() / image.spacing.array() + offset).floor();
        return index.max(0.0).min(size).cast<int>();
    };
    return {voxel(local.low, 0.5), voxel(local.high, 1.5)};
}

}  // namespace

void require_overlap(const SizeImage& image, const SurfaceMesh& surface) {
    const Box body = bounding_box(surface.vertices);
    const Box voxels = image.bounds();
    if (overlap(voxels, body)) {
        return;
    }
    std::string message = "size_image must overlap the surface, but it lies at " + span_of(voxels) +
                          " and the surface at " + span_of(body);
    if (overlap(voxels, mirrored(body))) {
        message += image.assumes_space
                       ? "; were the surface in RAS, which its frame doesn't say, they would"
                       : "; were the surface in the other of LPS and RAS, they would";
    }
    throw Error(ErrorCode::InvalidInput, message);
}

double mean_density(const SizeImage& image, const Box& box, double h_min, double h_max) {
    const auto [low, high] = voxels_in(image, box);
    double sum = 0.0;
    double count = 0.0;
    for (int k = low[2]; k < high[2]; ++k) {
        for (int j = low[1]; j < high[1]; ++j) {
            for (int i = low[0]; i < high[0]; ++i) {
                const std::size_t row =
                    static_cast<std::size_t>(k) * static_cast<std::size_t>(image.size[1]) +
                    static_cast<std::size_t>(j);
                const float size = image.sizes[row * static_cast<std::size_t>(image.size[0]) +
                                               static_cast<std::size_t>(i)];
                const double h =
                    is_wish(size) ? std::clamp(static_cast<double>(size), h_min, h_max) : h_max;
                sum += 1.0 / (h * h * h);
                count += 1.0;
            }
        }
    }
    // What the image doesn't cover asks for nothing.
    const Vec3 extent = box.high - box.low;
    const double all =
        std::max(count, extent.cwiseQuotient(image.spacing).cwiseMax(Vec3::Ones()).prod());
    return (sum + (all - count) / (h_max * h_max * h_max)) / all;
}

std::shared_ptr<const SizingSource> make_image_source(const SizeImage& image,
                                                      const SurfaceMesh& surface, double gradation,
                                                      double h_min, double h_max, RunContext& run) {
    require_overlap(image, surface);
    warn_of_coverage(image, surface.vertices, run);
    // A wish that is farther away than this doesn't reach the surface.
    const double reach = (h_max - h_min) / gradation;
    Box box = bounding_box(surface.vertices);
    box.low -= Vec3::Constant(reach);
    box.high += Vec3::Constant(reach);
    const auto [low, high] = voxels_in(image, box);
    auto blocks = BlockMaker(image, h_min, h_max, run).make(low, high);
    if (blocks.empty()) {
        run.warn({"SIZE_IMAGE_EMPTY",
                  "the size image asks for nothing below max_size near the surface", std::nullopt});
    }
    return std::make_shared<BlockSource>(std::move(blocks), image.axes, image.origin, gradation);
}

}  // namespace remesh
