#include "core/stages/smooth_skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "core/geometry/bvh.h"
#include "core/geometry/edge_table.h"
#include "core/geometry/mollified_winding.h"
#include "core/parallel.h"
#include "core/stages/chord_offset.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr double kNoisyShare = 0.45;    // Of the area: more that is rough is noise.
constexpr double kRoughCosine = 0.927;  // 22 degrees between triangle and smoothed surface.
constexpr double kMaxVolumeChange = 0.02;
constexpr double kDirectionCells = 50.0;       // Of a unit vector's components.
constexpr std::size_t kStairDirections = 300;  // Marching cubes give 26 to 62, noise 2,600.

class Smoother {
public:
    Smoother(SurfaceMesh skin, const WindingNumber& winding, const SmoothOptions& options,
             RunContext& run)
        : raw_(std::move(skin)),
          bvh_(raw_.vertices, raw_.triangles),
          field_(winding),
          options_(options),
          run_(run) {}

    SmoothResult smooth() {
        result_.surface = raw_;
        result_.noisy = is_noisy();
        raw_normals_ = vertex_normals(raw_);
        result_.normals = raw_normals_;
        run_.checkpoint();
        project();
        run_.checkpoint();
        find_closed_parts();
        if (!result_.noisy) {
            restore_volumes();
        }
        move_outward();
        measure();
        if (result_.noisy) {
            drop_unmoved();
        }
        return std::move(result_);
    }

private:
    static Points vertex_normals(const SurfaceMesh& surface) {
        Points normals(surface.vertices.size(), Vec3::Zero());
        for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
            const Vec3 area = area_vector(surface, i);
            for (const Index v : surface.triangles[i]) {
                normals[static_cast<std::size_t>(v)] += area;
            }
        }
        for (auto& n : normals) {
            n.normalize();
        }
        return normals;
    }

    /// Compares triangles, spread evenly over the area, with the smoothed field's direction. Stairs
    /// are as rough as noise, but face few directions; far smaller ones than elements go either
    /// way, sooner as noise.
    [[nodiscard]] bool is_noisy() const {
        constexpr std::size_t kSamples = 3000;
        const std::size_t n = raw_.triangles.size();
        std::vector<double> total(n);
        double sum = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            sum += area_vector(raw_, i).norm();
            total[i] = sum;
        }
        std::vector<std::size_t> sample(kSamples);
        std::set<std::array<long, 3>> directions;
        for (std::size_t k = 0; k < kSamples; ++k) {
            const double at = sum * (static_cast<double>(k) + 0.5) / kSamples;
            const auto found = std::lower_bound(total.begin(), total.end(), at);
            sample[k] = std::min(static_cast<std::size_t>(found - total.begin()), n - 1);
            const Vec3 cell = kDirectionCells * area_vector(raw_, sample[k]).normalized();
            directions.insert(
                {std::lround(cell.x()), std::lround(cell.y()), std::lround(cell.z())});
        }
        const double rough = sum_over(kSamples, [&](std::size_t k) {
            const Vec3 gradient =
                field_.at(centroid(raw_, sample[k]), 1.2 * options_.detail).gradient;
            const Vec3 normal = area_vector(raw_, sample[k]).normalized();
            return -normal.dot(gradient) < kRoughCosine * gradient.norm() ? 1.0 : 0.0;
        });
        const bool is_stairs = directions.size() <= std::min(kStairDirections, n / 4) &&
                               options_.stairs > 0.5 * options_.detail;
        return rough > kNoisyShare * kSamples && !is_stairs;
    }

    void project() {
        const bool is_noisy = result_.noisy;
        const double edge = is_noisy ? options_.mean_edge : options_.stairs;
        const double detail =
            is_noisy ? options_.detail : std::max(options_.detail, options_.stairs);
        const double radius = std::clamp(1.7 * edge, 0.6 * detail, 1.5 * detail);
        is_moved_.assign(raw_.vertices.size(), 0);
        for_each_index(raw_.vertices.size(), run_, [&](std::size_t i) {
            const auto moved = smooth_place(raw_.vertices[i], radius);
            if (moved) {
                result_.surface.vertices[i] = moved->point;
                result_.normals[i] = moved->normal;
                is_moved_[i] = 1;
            }
        });
    }

    [[nodiscard]] std::optional<MollifiedWinding::Projection> smooth_place(const Vec3& x,
                                                                           double radius) const {
        auto sample = field_.at(x, radius);
        for (int k = 0; k < 4 && !result_.noisy && !fits(x, sample, radius); ++k) {
            radius *= 0.7;
            sample = field_.at(x, radius);
        }
        auto place = field_.project(x, sample, radius, options_.reach);
        for (const double factor : {0.6, 0.35}) {
            if (!place) {
                const double smaller = factor * radius;
                place = field_.project(x, field_.at(x, smaller), smaller, options_.reach);
            }
        }
        return place;
    }

    /// Whether the field reaches inside and outside within about half of its radius.
    [[nodiscard]] bool fits(const Vec3& x, const MollifiedWinding::Sample& sample,
                            double radius) const {
        const double slope = sample.gradient.norm();
        if (!(slope > 0.0)) {
            return false;
        }
        const Vec3 inward = sample.gradient / slope;
        if (!has_wall(x, inward, radius) && !has_wall(x, -inward, radius)) {
            return true;
        }
        const Vec3 depth = 0.45 * radius * inward;
        return field_.at(x + depth, radius).value > 0.8 && field_.at(x - depth, radius).value < 0.2;
    }

    /// Whether another wall lies within the radius.
    [[nodiscard]] bool has_wall(const Vec3& x, const Vec3& direction, double radius) const {
        return bvh_
            .first_hit(x, direction, 0.1 * radius, radius, [](double, Index) { return true; })
            .has_value();
    }

    void find_closed_parts() {
        const EdgeTable table(raw_.triangles, raw_.vertices.size());
        DisjointSets sets(raw_.vertices.size());
        for (const Triangle& t : raw_.triangles) {
            sets.merge(t[0], t[1]);
            sets.merge(t[1], t[2]);
        }
        std::vector<char> is_open(raw_.vertices.size(), 0);
        for (const auto& edge : table.edges()) {
            if (edge.count != 2) {
                is_open[static_cast<std::size_t>(sets.find(edge.low))] = 1;
            }
        }
        part_.resize(raw_.vertices.size());
        std::vector<Index> number(raw_.vertices.size(), kNone);
        for (std::size_t i = 0; i < part_.size(); ++i) {
            const auto root = static_cast<std::size_t>(sets.find(static_cast<Index>(i)));
            if (!is_open[root] && number[root] == kNone) {
                number[root] = part_count_++;
                apex_.push_back(raw_.vertices[i]);
            }
            part_[i] = number[root];
        }
    }

    [[nodiscard]] std::vector<double> volumes(const SurfaceMesh& surface) const {
        std::vector<double> volume(static_cast<std::size_t>(part_count_), 0.0);
        for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
            const Index part = part_[static_cast<std::size_t>(surface.triangles[i][0])];
            if (part != kNone) {
                const auto p = static_cast<std::size_t>(part);
                volume[p] += cone_volume(surface, i, apex_[p]);
            }
        }
        return volume;
    }

    [[nodiscard]] std::vector<double> areas(const SurfaceMesh& surface) const {
        std::vector<double> area(static_cast<std::size_t>(part_count_), 0.0);
        for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
            const Index part = part_[static_cast<std::size_t>(surface.triangles[i][0])];
            if (part != kNone) {
                area[static_cast<std::size_t>(part)] += area_vector(surface, i).norm();
            }
        }
        return area;
    }

    void restore_volumes() {
        const auto wanted = volumes(raw_);
        auto& surface = result_.surface;
        for (int pass = 0; pass < 3; ++pass) {
            const auto volume = volumes(surface);
            const auto area = areas(surface);
            for (std::size_t i = 0; i < part_.size(); ++i) {
                if (part_[i] != kNone) {
                    const auto p = static_cast<std::size_t>(part_[i]);
                    const double offset = (wanted[p] - volume[p]) / area[p];
                    const double bound = 0.1 * options_.detail;
                    surface.vertices[i] += std::clamp(offset, -bound, bound) * result_.normals[i];
                }
            }
        }
        const auto volume = volumes(surface);
        std::vector<char> is_raw(volume.size(), 0);
        for (std::size_t p = 0; p < volume.size(); ++p) {
            is_raw[p] = std::abs(volume[p] - wanted[p]) > kMaxVolumeChange * std::abs(wanted[p]);
            result_.parts_kept_raw += is_raw[p];
        }
        for (std::size_t i = 0; i < part_.size(); ++i) {
            if (part_[i] != kNone && is_raw[static_cast<std::size_t>(part_[i])]) {
                surface.vertices[i] = raw_.vertices[i];
                result_.normals[i] = raw_normals_[i];
            }
        }
    }

    /// So that the triangles to come, chords of this surface, enclose what it encloses now.
    void move_outward() {
        const auto offset = chord_offsets(result_.surface, result_.normals, options_.h);
        for (std::size_t i = 0; i < offset.size(); ++i) {
            result_.surface.vertices[i] += offset[i] * result_.normals[i];
        }
    }

    void measure() {
        double sum = 0.0;
        for (std::size_t i = 0; i < raw_.vertices.size(); ++i) {
            const double moved = (result_.surface.vertices[i] - raw_.vertices[i]).norm();
            result_.max_displacement = std::max(result_.max_displacement, moved);
            sum += moved;
            result_.unmoved += !is_moved_[i];
        }
        result_.mean_displacement = sum / static_cast<double>(raw_.vertices.size());
    }

    /// In noise, what found no smooth place is a spike; the gap it leaves is smaller than h.
    void drop_unmoved() {
        auto& surface = result_.surface;
        std::size_t kept = 0;
        for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
            const Triangle& t = surface.triangles[i];
            if (std::all_of(t.begin(), t.end(),
                            [&](Index v) { return is_moved_[static_cast<std::size_t>(v)] != 0; })) {
                if (!surface.patch.empty()) {
                    surface.patch[kept] = surface.patch[i];
                }
                surface.triangles[kept++] = t;
            }
        }
        surface.triangles.resize(kept);
        surface.patch.resize(surface.patch.empty() ? 0 : kept);
    }

    SurfaceMesh raw_;
    Bvh bvh_;
    MollifiedWinding field_;
    const SmoothOptions& options_;
    RunContext& run_;
    Points raw_normals_;
    std::vector<char> is_moved_;
    std::vector<Index> part_;  // Closed part of each vertex, or kNone.
    Index part_count_ = 0;
    Points apex_;  // A vertex of each closed part.
    SmoothResult result_;
};

}  // namespace

SmoothResult smooth_skin(SurfaceMesh skin, const WindingNumber& winding,
                         const SmoothOptions& options, RunContext& run) {
    return Smoother(std::move(skin), winding, options, run).smooth();
}

}  // namespace remesh
