#include "core/stages/carve.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/number_text.h"
#include "core/parallel.h"
#include "core/stages/manifold_labels.h"

namespace remesh {
namespace {

using Labels = std::vector<std::uint8_t>;

// Flatness is 6 V over the product of the three edges at the first corner; 0.71 when regular.
constexpr double kFlat = 0.03;      // A surface tet below this stays out at first.
constexpr double kTooFlat = 0.01;   // A tet below this is never switched in.
constexpr double kHopeless = 1e-9;  // A void with a tet below this isn't filled.
constexpr double kWideInner = 1.0;  // Circumradius over h from which a tet with a volume vertex
constexpr double kWideOuter = 1.2;  // or one with surface vertices only is judged by its centroid.
constexpr double kNearSurface = 0.3;  // Depth over h up to which a surface tet matters less.
constexpr double kNotablePart = 1.0;  // Over h^3: what is smaller is a crumb.

struct TetShape {
    double h = 0.0;         // Wanted spacing.
    double volume = 0.0;    // Over h^3.
    double flatness = 0.0;  // See above.
    double radius = 0.0;    // Of the circumsphere, over h; infinite if it can't be computed.
    Vec3 centroid = Vec3::Zero();
    Vec3 circumcentre = Vec3::Zero();
    int surface_corners = 0;
};

class Carver {
public:
    Carver(const Particles& particles, const TetComplex& delaunay, const Domain& domain,
           const CarveOptions& options, RunContext& run)
        : particles_(particles),
          delaunay_(delaunay),
          domain_(domain),
          bounds_(domain.bounds()),
          options_(options),
          run_(run),
          inside_(delaunay.tets.size()) {}

    CarveResult carve() {
        for_each_index(inside_.size(), run_,
                       [&](std::size_t t) { inside_[t] = lies_inside(static_cast<Index>(t)); });
        run_.report(0.5);
        drop_parts_and_fill_voids();
        run_.report(0.6);
        if (make_manifold()) {
            drop_parts_and_fill_voids();
        }
        run_.report(0.9);
        return take_result();
    }

private:
    [[nodiscard]] double volume6(Index t) const {
        const Tet& tet = delaunay_.tets[t];
        const Vec3& a = particles_.position[tet[0]];
        return (particles_.position[tet[1]] - a)
            .dot((particles_.position[tet[2]] - a).cross(particles_.position[tet[3]] - a));
    }

    [[nodiscard]] double spacing(Index t) const {
        double sum = 0.0;
        for (const Index v : delaunay_.tets[t]) {
            sum += particles_.h[v];
        }
        return sum / 4.0;
    }

    [[nodiscard]] int surface_corners(Index t) const {
        const Tet& tet = delaunay_.tets[t];
        return static_cast<int>(std::count_if(tet.begin(), tet.end(), [&](Index v) {
            return particles_.kind[v] != ParticleKind::Volume;
        }));
    }

    [[nodiscard]] TetShape shape(Index t) const {
        const Tet& tet = delaunay_.tets[t];
        const Vec3& a = particles_.position[tet[0]];
        const Vec3 u = particles_.position[tet[1]] - a;
        const Vec3 v = particles_.position[tet[2]] - a;
        const Vec3 w = particles_.position[tet[3]] - a;
        const double six_volumes = u.dot(v.cross(w));

        TetShape shape;
        shape.h = spacing(t);
        shape.volume = six_volumes / (6.0 * shape.h * shape.h * shape.h);
        shape.flatness = six_volumes / (u.norm() * v.norm() * w.norm());
        shape.centroid = a + (u + v + w) / 4.0;
        shape.surface_corners = surface_corners(t);
        const Vec3 to_centre = (v.cross(w) * u.squaredNorm() + w.cross(u) * v.squaredNorm() +
                                u.cross(v) * w.squaredNorm()) /
                               (2.0 * six_volumes);
        const bool has_centre = shape.flatness > kHopeless && to_centre.allFinite();
        shape.circumcentre = has_centre ? Vec3(a + to_centre) : shape.centroid;
        shape.radius =
            has_centre ? to_centre.norm() / shape.h : std::numeric_limits<double>::infinity();
        return shape;
    }

    [[nodiscard]] bool is_inside_domain(const Vec3& point) const {
        return (point.array() >= bounds_.low.array()).all() &&
               (point.array() <= bounds_.high.array()).all() && domain_.region_at(point) != 0;
    }

    [[nodiscard]] bool lies_inside(Index t) const {
        if (surface_corners(t) == 0) {
            return true;
        }
        const TetShape tet = shape(t);
        if (tet.surface_corners < 4) {
            return tet.radius <= kWideInner || is_inside_domain(tet.centroid);
        }
        return tet.flatness >= kFlat &&
               is_inside_domain(tet.radius < kWideOuter ? tet.circumcentre : tet.centroid);
    }

    // A tet of surface vertices near the boundary may go either way; the others matter more.
    [[nodiscard]] SwitchCost switch_cost(Index t, bool was_inside) const {
        const TetShape tet = shape(t);
        SwitchCost cost{.may_enter = tet.flatness >= kTooFlat};
        double harm = 0.0;
        if (tet.surface_corners < 4) {
            cost.keep = was_inside && tet.radius < kWideInner;
            harm = 2.0 * tet.volume + (cost.keep ? 4.0 * tet.volume + 0.05 : 0.0);
        } else {
            const auto nearest = domain_.closest_within(tet.centroid, kNearSurface * tet.h);
            const double depth = nearest ? nearest->distance / (kNearSurface * tet.h) : 1.0;
            harm = tet.volume * std::min(1.0, depth + 0.02);
        }
        cost.harm = static_cast<float>(harm);
        return cost;
    }

    // Returns whether any label changed.
    bool make_manifold() {
        const Labels before = inside_;
        ManifoldLabels labels(
            delaunay_, particles_.size(), std::move(inside_),
            [&](Index t) { return switch_cost(t, before[t] != 0); }, run_);
        labels.switch_greedily();
        labels.remove_until_manifold();
        forced_steps_ = labels.forced_steps();
        inside_ = labels.inside();
        return labels.switches() > 0;
    }

    // Tets of one label that are connected through faces.
    struct Part {
        bool is_inside = false;
        bool is_enclosed = true;  // Doesn't reach the hull.
        bool is_hopeless = false;
        double volume = 0.0;
        double relative_volume = 0.0;  // Sum of V / h^3.
        Index first = kNone;
    };

    void drop_parts_and_fill_voids() {
        std::vector<Index> part_of(inside_.size(), kNone);
        std::vector<Part> parts;
        for (std::size_t t = 0; t < inside_.size(); ++t) {
            if (part_of[t] == kNone) {
                parts.push_back(
                    flood(static_cast<Index>(t), static_cast<Index>(parts.size()), part_of));
            }
        }
        double largest = 0.0;
        for (const auto& part : parts) {
            largest = std::max(largest, part.is_inside ? part.volume : 0.0);
        }
        std::vector<std::uint8_t> is_switched(parts.size(), 0);
        for (std::size_t i = 0; i < parts.size(); ++i) {
            const Part& part = parts[i];
            if (part.is_inside) {
                is_switched[i] =
                    part.volume < largest && (part.relative_volume < options_.min_part_volume ||
                                              part.volume < options_.min_part_share * largest);
                if (is_switched[i]) {
                    note_dropped(part);
                }
            } else {
                is_switched[i] = part.is_enclosed && !part.is_hopeless &&
                                 part.relative_volume < options_.max_void_volume;
                filled_voids_ += is_switched[i];
            }
        }
        for_each_index(inside_.size(), run_,
                       [&](std::size_t t) { inside_[t] ^= is_switched[part_of[t]]; });
    }

    void note_dropped(const Part& part) {
        ++dropped_parts_;
        if (part.relative_volume >= kNotablePart && notable_parts_++ == 0) {
            notable_part_ = shape(part.first).centroid;
        }
    }

    Part flood(Index seed, Index id, std::vector<Index>& part_of) {
        run_.checkpoint();
        Part part{.is_inside = inside_[seed] != 0, .first = seed};
        part_of[seed] = id;
        stack_.assign(1, seed);
        while (!stack_.empty()) {
            const Index t = stack_.back();
            stack_.pop_back();
            const double h = spacing(t);
            const double volume = volume6(t) / 6.0;
            part.volume += volume;
            part.relative_volume += volume / (h * h * h);
            part.is_hopeless |= !part.is_inside && shape(t).flatness < kHopeless;
            for (const Index other : delaunay_.neighbours[t]) {
                if (other == kNone) {
                    part.is_enclosed = false;
                } else if (part_of[other] == kNone && inside_[other] == inside_[seed]) {
                    part_of[other] = id;
                    stack_.push_back(other);
                }
            }
        }
        return part;
    }

    CarveResult take_result() {
        const auto count = std::count(inside_.begin(), inside_.end(), std::uint8_t{1});
        if (count == 0) {
            throw Error(ErrorCode::Unmeshable,
                        "no tetrahedron of " + std::to_string(inside_.size()) +
                            " lies inside the body: it is too thin or too small for the edge "
                            "length");
        }
        CarveResult result;
        result.dropped_parts = dropped_parts_;
        result.notable_parts = notable_parts_;
        result.notable_part = notable_part_;
        result.filled_voids = filled_voids_;
        result.forced_steps = forced_steps_;
        result.mesh.vertices = particles_.position;
        result.mesh.tets.reserve(static_cast<std::size_t>(count));
        for (std::size_t t = 0; t < inside_.size(); ++t) {
            if (inside_[t] != 0) {
                result.mesh.tets.push_back(delaunay_.tets[t]);
            }
        }
        result.kind = relabelled_kinds();
        return result;
    }

    [[nodiscard]] std::vector<ParticleKind> relabelled_kinds() const {
        std::vector<ParticleKind> kind(particles_.size(), ParticleKind::Volume);
        for (std::size_t t = 0; t < inside_.size(); ++t) {
            if (inside_[t] == 0) {
                continue;
            }
            for (std::size_t face = 0; face < 4; ++face) {
                const Index other = delaunay_.neighbours[t][face];
                if (other != kNone && inside_[other] != 0) {
                    continue;
                }
                for (std::size_t corner = 0; corner < 4; ++corner) {
                    const Index v = delaunay_.tets[t][corner];
                    if (corner != face) {
                        kind[v] = std::max(ParticleKind::Surface, particles_.kind[v]);
                    }
                }
            }
        }
        return kind;
    }

    const Particles& particles_;
    const TetComplex& delaunay_;
    const Domain& domain_;
    const Box bounds_;
    const CarveOptions& options_;
    RunContext& run_;
    Labels inside_;
    std::vector<Index> stack_;
    std::int64_t dropped_parts_ = 0;
    std::int64_t notable_parts_ = 0;
    std::optional<Vec3> notable_part_;
    std::int64_t filled_voids_ = 0;
    std::int64_t forced_steps_ = 0;
};

void require_at_least_zero(const char* field, double value) {
    if (!(value >= 0.0) || !std::isfinite(value)) {
        throw Error(ErrorCode::InvalidInput, "carve." + std::string(field) +
                                                 " must be at least 0 and finite, got " +
                                                 number_text(value));
    }
}

}  // namespace

CarveResult carve_domain(const Particles& particles, const TetComplex& delaunay,
                         const Domain& domain, const CarveOptions& options, RunContext& run) {
    validate(options);
    run.checkpoint();
    return Carver(particles, delaunay, domain, options, run).carve();
}

void validate(const CarveOptions& options) {
    require_at_least_zero("min_part_volume", options.min_part_volume);
    require_at_least_zero("max_void_volume", options.max_void_volume);
    if (!(options.min_part_share >= 0.0 && options.min_part_share < 1.0)) {
        throw Error(ErrorCode::InvalidInput, "carve.min_part_share must be in [0, 1), got " +
                                                 number_text(options.min_part_share));
    }
}

}  // namespace remesh
