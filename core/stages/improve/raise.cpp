#include "core/stages/improve/raise.h"

#include <algorithm>
#include <array>
#include <vector>

namespace remesh::improve {
namespace {

constexpr double kLift = 1e-2;    // Of volumes in stars that have a flat tet.
constexpr double kMaxStep = 0.3;  // Of the mean edge at the vertex.
constexpr double kLeastGain = 1e-6;
constexpr double kFlatLimit = 10.0 * Star::kFlat;

// A vertex on its way, and how good its star is there.
struct Candidate {
    Place place{};
    double worst = 0.0;
};

// Coordinates along which a vertex may move.
struct Frame {
    std::array<Vec3, 3> axes{};
    int dimension = 3;
};

Frame frame_of(ParticleKind kind, const Vec3& axis) {
    if (kind == ParticleKind::Curve) {
        return {{axis, Vec3::Zero(), Vec3::Zero()}, 1};
    }
    if (kind == ParticleKind::Surface) {
        const Vec3 e = axis.unitOrthogonal();
        return {{e, axis.cross(e), Vec3::Zero()}, 2};
    }
    return {{Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}, 3};
}

// The point closest to the origin in the convex hull of some gradients: the direction in which the
// one that rises least rises most. By Gilbert's iteration.
Vec3 shortest_in_hull(const std::vector<Vec3>& gradients) {
    constexpr int kSteps = 40;
    Vec3 x = gradients.front();
    for (int step = 0; step < kSteps; ++step) {
        const auto& least =
            *std::min_element(gradients.begin(), gradients.end(),
                              [&](const Vec3& a, const Vec3& b) { return a.dot(x) < b.dot(x); });
        const Vec3 apart = x - least;
        const double squared = apart.squaredNorm();
        if (squared <= 0.0 || x.dot(apart) <= 1e-6 * x.squaredNorm()) {
            break;
        }
        x -= apart * std::min(1.0, x.dot(apart) / squared);
    }
    return x;
}

class Raiser {
public:
    Raiser(const LiveMesh& mesh, const Shape& shape, Index v, Star& star)
        : mesh_(mesh),
          shape_(shape),
          v_(v),
          kind_(mesh.kind(v)),
          star_(star),
          now_{{mesh.point(v), mesh.anchor(v)}, star.worst(mesh.point(v))} {}

    void newton() {
        constexpr int kSteps = 4;
        for (int i = 0; i < kSteps; ++i) {
            const Vec3& x = now_.place.point;
            const double lift = star_.flatness(x) <= kFlatLimit ? kLift : 0.0;
            const Vec3 step =
                descent(star_.model(x, lift), kind_, bound_axis(mesh_, shape_, v_, star_));
            if (!advance(step, 4)) {
                break;
            }
        }
    }

    void ascend() {
        constexpr int kSteps = 8;
        double margin = 0.02;
        for (int i = 0; i < kSteps; ++i) {
            if (!advance(steepest(margin), 6)) {
                if (margin > 0.05) {
                    break;
                }
                margin = 0.08;
            }
        }
    }

    [[nodiscard]] const Candidate& now() const { return now_; }

private:
    // Steps as far as kMaxStep allows, or less, to where the worst element is better.
    bool advance(Vec3 step, int attempts) {
        const Vec3 x = now_.place.point;
        const double edge = star_.edge_length(x);
        const double length = step.norm();
        if (!(length > 1e-4 * edge)) {
            return false;
        }
        if (length > kMaxStep * edge) {
            step *= kMaxStep * edge / length;
        }
        for (int attempt = 0; attempt < attempts; ++attempt, step *= 0.4) {
            const Place place = place_on(shape_, kind_, now_.place.anchor, x + step);
            const double worst = star_.worst(place.point);
            if (worst > now_.worst + kLeastGain && star_.flatness(place.point) > kFlatLimit &&
                !star_.folds(x, place.point)) {
                now_ = {place, worst};
                return true;
            }
        }
        return false;
    }

    // Common ascent of all elements at most `margin` better than the worst one, as long as a step
    // may be.
    Vec3 steepest(double margin) {
        const Vec3 x = now_.place.point;
        const Frame frame = frame_of(kind_, bound_axis(mesh_, shape_, v_, star_));
        const double reach = 1e-4 * star_.edge_length(x);
        star_.sines(x, values_);
        gradients_.assign(values_.size(), Vec3::Zero());
        for (int k = 0; k < frame.dimension; ++k) {
            const Vec3& axis = frame.axes[static_cast<std::size_t>(k)];
            star_.sines(x + reach * axis, ahead_);
            star_.sines(x - reach * axis, behind_);
            for (std::size_t i = 0; i < values_.size(); ++i) {
                gradients_[i] += (ahead_[i] - behind_[i]) * axis;
            }
        }
        std::size_t active = 0;
        for (std::size_t i = 0; i < values_.size(); ++i) {
            if (values_[i] < now_.worst + margin) {
                gradients_[active++] = gradients_[i] / (2.0 * reach);
            }
        }
        gradients_.resize(active);
        if (gradients_.empty()) {
            return Vec3::Zero();
        }
        const Vec3 direction = shortest_in_hull(gradients_);
        const double length = direction.norm();
        const double edge = star_.edge_length(x);
        return length * edge > 1e-3 ? Vec3(direction * (kMaxStep * edge / length))
                                    : Vec3(Vec3::Zero());
    }

    const LiveMesh& mesh_;
    const Shape& shape_;
    Index v_;
    ParticleKind kind_;
    Star& star_;
    Candidate now_;
    std::vector<double> values_{};
    std::vector<double> ahead_{};
    std::vector<double> behind_{};
    std::vector<Vec3> gradients_{};
};

}  // namespace

bool raise_worst(LiveMesh& mesh, const Shape& shape, Index v, Effort effort, Star& star) {
    if (mesh.is_locked(v) || mesh.kind(v) == ParticleKind::Corner) {
        return false;
    }
    star.gather(mesh, v);
    if (star.empty()) {
        return false;
    }
    Raiser raiser(mesh, shape, v, star);
    const double before = raiser.now().worst;
    raiser.newton();
    if (effort == Effort::Full) {
        raiser.ascend();
    }
    if (raiser.now().worst <= before) {
        return false;
    }
    mesh.move_recorded(v, raiser.now().place.point, raiser.now().place.anchor);
    return true;
}

}  // namespace remesh::improve
