#include "core/stages/improve/smooth.h"

#include <Eigen/Cholesky>

#include <cmath>

#include "core/parallel.h"
#include "core/stages/improve/measures.h"

namespace remesh::improve {
namespace {

constexpr double kMaxStep = 0.3;     // Of the mean edge at the vertex.
constexpr double kLeastMove = 3e-3;  // Shorter ones aren't worth a try.
constexpr double kStillMove = 2e-2;  // Shorter moves don't wake the neighbours.
constexpr double kLift = 1e-2;       // Of volumes in stars that have a flat tet.
constexpr std::size_t kBlock = 256;

// Vertices to smooth, grouped by colour.
struct Colouring {
    std::vector<Index> vertices{};
    std::vector<std::size_t> begin{};  // Per colour, and one past the last.
};

bool needs_smoothing(const LiveMesh& mesh, Index v) {
    if (mesh.is_locked(v) || mesh.kind(v) == ParticleKind::Corner) {
        return false;
    }
    for (const Index t : mesh.around(v)) {
        for (const Index w : mesh.tet(t)) {
            if (mesh.has_changed(w)) {
                return true;
            }
        }
    }
    return false;
}

// Greedy, in index order. Colours beyond 63 share the last one and run serially.
Colouring colour_vertices(const LiveMesh& mesh, const std::vector<std::uint8_t>& wanted) {
    constexpr std::uint8_t kUncoloured = 255;
    constexpr std::size_t kColours = 64;
    std::vector<std::uint8_t> colour(mesh.vertex_count(), kUncoloured);
    std::array<std::size_t, kColours> count{};
    for (std::size_t v = 0; v < colour.size(); ++v) {
        if (!wanted[v]) {
            continue;
        }
        std::uint64_t used = 0;
        for (const Index t : mesh.around(index(v))) {
            for (const Index w : mesh.tet(t)) {
                if (colour[at(w)] < kColours) {
                    used |= std::uint64_t{1} << colour[at(w)];
                }
            }
        }
        const int free = std::countr_one(used);
        colour[v] = static_cast<std::uint8_t>(std::min<int>(free, kColours - 1));
        ++count[colour[v]];
    }

    Colouring result;
    result.begin.assign(1, 0);
    for (const std::size_t n : count) {
        result.begin.push_back(result.begin.back() + n);
    }
    result.vertices.resize(result.begin.back());
    std::vector<std::size_t> next(result.begin.begin(), result.begin.end() - 1);
    for (std::size_t v = 0; v < colour.size(); ++v) {
        if (colour[v] < kColours) {
            result.vertices[next[colour[v]]++] = index(v);
        }
    }
    return result;
}

// Returns the length of the move relative to the mean edge.
double smooth_vertex(LiveMesh& mesh, const Shape& shape, Index v, double floor, Star& star) {
    star.gather(mesh, v);
    if (star.empty()) {
        return 0.0;
    }
    const Vec3 x = mesh.point(v);
    const double edge = star.edge_length(x);
    const double flatness = star.flatness(x);
    const bool is_flat = flatness <= 10.0 * Star::kFlat;
    const double lift = is_flat ? kLift : 0.0;
    const auto model = star.model(x, lift);
    const Vec3 axis = bound_axis(mesh, shape, v, star);
    Vec3 step = descent(model, mesh.kind(v), axis);
    const double length = step.norm();
    if (!(length > kLeastMove * edge)) {
        return 0.0;
    }
    if (length > kMaxStep * edge) {
        step *= kMaxStep * edge / length;
    }
    for (int attempt = 0; attempt < 4; ++attempt, step *= 0.4) {
        const Place place = place_on(shape, mesh.kind(v), mesh.anchor(v), x + step);
        const double energy =
            is_flat ? star.lifted_energy(place.point, lift) : star.energy(place.point);
        if (!(energy < model.energy * (1.0 - 1e-6))) {
            continue;
        }
        // A lifted energy is finite for inverted tets too.
        if (is_flat && star.flatness(place.point) < std::max(flatness, 0.0)) {
            continue;
        }
        if (star.folds(x, place.point)) {
            continue;
        }
        if (floor > 0.0 && star.worst(place.point) < std::min(floor, star.worst(x))) {
            continue;
        }
        mesh.move(v, place.point, place.anchor);
        return (place.point - x).norm() / edge;
    }
    return 0.0;
}

}  // namespace

Vec3 descent(const Star::Model& model, ParticleKind kind, const Vec3& axis) {
    if (kind == ParticleKind::Volume) {
        const Eigen::LLT<Eigen::Matrix3d> factor(model.hessian);
        if (factor.info() == Eigen::Success) {
            return -factor.solve(model.gradient);
        }
        return -model.gradient / (model.hessian.norm() + 1e-300);
    }
    if (kind == ParticleKind::Curve) {
        const double slope = axis.dot(model.gradient);
        const double bend = std::abs(axis.dot(model.hessian * axis));
        return axis * (-slope / (bend + 1e-300));
    }
    const Vec3 e1 = axis.unitOrthogonal();
    const Vec3 e2 = axis.cross(e1);
    const double g1 = e1.dot(model.gradient);
    const double g2 = e2.dot(model.gradient);
    const double h11 = e1.dot(model.hessian * e1);
    const double h12 = e1.dot(model.hessian * e2);
    const double h22 = e2.dot(model.hessian * e2);
    const double determinant = h11 * h22 - h12 * h12;
    if (h11 > 0.0 && determinant > 1e-9 * h11 * h22) {
        return (-(h22 * g1 - h12 * g2) * e1 - (h11 * g2 - h12 * g1) * e2) / determinant;
    }
    return -(g1 * e1 + g2 * e2) / (std::abs(h11) + std::abs(h22) + std::abs(h12) + 1e-300);
}

Vec3 bound_axis(const LiveMesh& mesh, const Shape& shape, Index v, const Star& star) {
    switch (mesh.kind(v)) {
        case ParticleKind::Curve:
            return closest_on_curve(shape.features.curves[at(mesh.anchor(v))], mesh.point(v))
                .tangent;
        case ParticleKind::Surface: return star.fan_normal(mesh.point(v)).normalized();
        case ParticleKind::Volume:
        case ParticleKind::Corner: break;
    }
    return Vec3::Zero();
}

Place place_on(const Shape& shape, ParticleKind kind, Index anchor, const Vec3& point) {
    if (kind == ParticleKind::Surface) {
        const auto found = shape.domain.closest(point, anchor);
        return {found.point, found.facet};
    }
    if (kind == ParticleKind::Curve) {
        return {closest_on_curve(shape.features.curves[at(anchor)], point).point, anchor};
    }
    return {point, anchor};
}

double departure(const Shape& shape, const Vec3& a, const Vec3& b, const Vec3& c) {
    constexpr double kCosine = 0.6;
    constexpr double kDistance = 0.2;  // Of the mean edge.
    const double edge = ((b - a).norm() + (c - b).norm() + (a - c).norm()) / 3.0;
    const auto on = shape.domain.closest((a + b + c) / 3.0);
    const double cosine = (b - a).cross(c - a).normalized().dot(on.normal);
    return std::max(0.0, on.distance / edge - kDistance) + std::max(0.0, kCosine - cosine);
}

SmoothResult smooth_vertices(LiveMesh& mesh, const Shape& shape, double power,
                             double surface_weight, double floor, const RunContext& run) {
    const std::size_t n = mesh.vertex_count();
    std::vector<std::uint8_t> wanted(n, 0);
    for_each_index(n, run,
                   [&](std::size_t v) { wanted[v] = needs_smoothing(mesh, index(v)) ? 1 : 0; });
    const Colouring colours = colour_vertices(mesh, wanted);
    std::vector<float> move(n, 0.0F);
    const auto smooth_range = [&](std::size_t begin, std::size_t end) {
        Star star(power, surface_weight);
        for (std::size_t i = begin; i < end; ++i) {
            const Index v = colours.vertices[i];
            move[at(v)] = static_cast<float>(smooth_vertex(mesh, shape, v, floor, star));
        }
    };
    for (std::size_t colour = 0; colour + 1 < colours.begin.size(); ++colour) {
        const std::size_t first = colours.begin[colour];
        const std::size_t count = colours.begin[colour + 1] - first;
        if (colour + 2 == colours.begin.size()) {
            smooth_range(first, first + count);  // May share tets: see colour_vertices.
        } else {
            for_each_block(count, kBlock, run, [&](std::size_t begin, std::size_t end) {
                smooth_range(first + begin, first + end);
            });
        }
    }

    SmoothResult result;
    for (std::size_t v = 0; v < n; ++v) {
        const auto length = static_cast<double>(move[v]);
        mesh.set_changed(index(v), length > kStillMove);
        result.moved += length > 0.0;
        result.max_move = std::max(result.max_move, length);
        result.sum_squares += length * length;
    }
    return result;
}

}  // namespace remesh::improve
