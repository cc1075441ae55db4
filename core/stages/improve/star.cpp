#include "core/stages/improve/star.h"

#include <cmath>
#include <limits>

#include "core/stages/improve/measures.h"

namespace remesh::improve {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Sum of squared edges over the power of the volume that makes phi^3 free of roots:
// phi^3 = L^3 / (432 (6V)^2).
constexpr double kTetPhi = 1.0 / 432.0;
constexpr double kTrianglePhi = 0.28867513459481287;  // 1 / (2 sqrt(3)), over twice the area.

double squared_edges(const Vec3& u, const Vec3& v, const Vec3& w) {
    return u.squaredNorm() + v.squaredNorm() + w.squaredNorm() + (u - v).squaredNorm() +
           (v - w).squaredNorm() + (w - u).squaredNorm();
}

double cubed(double x) {
    return x * x * x;
}

// Length scale cubed of a tet from its squared edges: the mean squared edge to the 3/2.
double cubed_length(double squares) {
    const double mean = squares / 6.0;
    return mean * std::sqrt(mean);
}

}  // namespace

void Star::gather(const LiveMesh& mesh, Index v) {
    tets_.clear();
    triangles_.clear();
    tet_scale_ = mesh.tet_scale();
    for (const Index t : mesh.around(v)) {
        const auto& tet = mesh.tet(t);
        const std::size_t corner = tet[0] == v ? 0 : tet[1] == v ? 1 : tet[2] == v ? 2 : 3;
        const auto& order = kToFront[corner];
        tets_.push_back(
            {mesh.point(tet[order[1]]), mesh.point(tet[order[2]]), mesh.point(tet[order[3]])});
    }
    if (mesh.on_boundary(v)) {
        mesh.boundary_fan(v, fan_);
        for (const auto& [from, to] : fan_) {
            triangles_.push_back({mesh.point(from), mesh.point(to)});
        }
    }
}

// phi^p from phi^3.
double Star::raised(double phi_cubed) const {
    if (power_ == 3.0) {
        return phi_cubed;
    }
    if (power_ == 6.0) {
        return phi_cubed * phi_cubed;
    }
    return std::pow(phi_cubed, power_ / 3.0);
}

double Star::energy(const Vec3& x) const {
    double sum = 0.0;
    for (const auto& tet : tets_) {
        const Vec3 u = tet.a - x;
        const Vec3 v = tet.b - x;
        const Vec3 w = tet.c - x;
        const double volume = u.dot(v.cross(w));
        const double squares = squared_edges(u, v, w);
        if (!(volume > 0.0) || volume * volume <= kFlat * kFlat * cubed(squares / 6.0)) {
            return kInfinity;
        }
        sum += raised(kTetPhi * cubed(squares) / (volume * volume));
    }
    double triangle_sum = 0.0;
    for (const auto& triangle : triangles_) {
        const Vec3 u = triangle.from - x;
        const Vec3 v = triangle.to - x;
        const double squares = u.squaredNorm() + v.squaredNorm() + (u - v).squaredNorm();
        const double area = u.cross(v).norm();
        triangle_sum += raised(cubed(kTrianglePhi * squares / (area + 1e-30)));
    }
    return sum + surface_weight_ * triangle_sum;
}

double Star::flatness(const Vec3& x) const {
    double least = kInfinity;
    for (const auto& tet : tets_) {
        const Vec3 u = tet.a - x;
        const Vec3 v = tet.b - x;
        const Vec3 w = tet.c - x;
        const double scale = cubed_length(squared_edges(u, v, w));
        least = std::min(least, scale > 0.0 ? u.dot(v.cross(w)) / scale : 0.0);
    }
    return least;
}

double Star::lifted_energy(const Vec3& x, double lift) const {
    return model(x, lift).energy;
}

Star::Model Star::model(const Vec3& x, double lift) const {
    Model m;
    const double p = power_;
    const auto add = [&](double value, const Vec3& slope, double curvature, const Vec3& edges,
                         double squares, const Vec3& size, double bend) {
        // value = exp(p g): gradient p value g', Hessian value (p^2 g' g'^T + p g'').
        m.energy += value;
        m.gradient += (p * value) * slope;
        m.hessian += (p * value) * (p * slope * slope.transpose() -
                                    edges * edges.transpose() / (squares * squares) +
                                    bend * size * size.transpose());
        m.hessian.diagonal().array() += p * value * curvature / squares;
    };
    for (const auto& tet : tets_) {
        const Vec3 u = tet.a - x;
        const Vec3 v = tet.b - x;
        const Vec3 w = tet.c - x;
        const double squares = squared_edges(u, v, w);
        const Vec3 normal = -(tet.b - tet.a).cross(tet.c - tet.a);  // Gradient of 6V.
        double volume = u.dot(v.cross(w));
        double chain = 1.0;
        if (lift > 0.0) {
            const double delta = lift * cubed_length(squares);
            const double root = std::sqrt(volume * volume + 4.0 * delta * delta);
            chain = 0.5 * (1.0 + volume / root);
            volume = 0.5 * (volume + root);
        }
        const Vec3 edges = -2.0 * (u + v + w);  // Gradient of the sum of squares.
        const Vec3 size = normal * (chain / volume);
        const double value = raised(kTetPhi * cubed(squares) / (volume * volume));
        add(value, edges / squares - (2.0 / 3.0) * size, 6.0, edges, squares, size, 2.0 / 3.0);
    }
    for (const auto& triangle : triangles_) {
        const Vec3 u = triangle.from - x;
        const Vec3 v = triangle.to - x;
        const double squares = u.squaredNorm() + v.squaredNorm() + (u - v).squaredNorm();
        const Vec3 cross = u.cross(v);
        const double area = cross.norm() + 1e-30;
        const Vec3 edges = -2.0 * (u + v);
        const Vec3 size = (u - v).cross(cross) / (area * area);
        const double value = surface_weight_ * raised(cubed(kTrianglePhi * squares / area));
        add(value, edges / squares - size, 4.0, edges, squares, size, 1.0);
    }
    return m;
}

Vec3 Star::fan_normal(const Vec3& x) const {
    Vec3 sum = Vec3::Zero();
    for (const auto& triangle : triangles_) {
        sum += (triangle.from - x).cross(triangle.to - x);
    }
    return sum;
}

double Star::fan_cosine(const Vec3& x) const {
    const Vec3 mean = fan_normal(x).normalized();
    double least = 1.0;
    for (const auto& triangle : triangles_) {
        const Vec3 normal = (triangle.from - x).cross(triangle.to - x);
        least = std::min(least, normal.dot(mean) / (normal.norm() + 1e-300));
    }
    return least;
}

bool Star::folds(const Vec3& from, const Vec3& to) const {
    constexpr double kFoldCosine = 0.5;
    if (triangles_.empty()) {
        return false;
    }
    const double cosine = fan_cosine(to);
    return cosine < kFoldCosine && cosine < fan_cosine(from);
}

double Star::edge_length(const Vec3& x) const {
    double sum = 0.0;
    for (const auto& tet : tets_) {
        sum += (tet.a - x).norm() + (tet.b - x).norm() + (tet.c - x).norm();
    }
    return tets_.empty() ? 0.0 : sum / (3.0 * static_cast<double>(tets_.size()));
}

double Star::worst(const Vec3& x) const {
    double least = 1.0;
    for (const auto& tet : tets_) {
        least = std::min(least, tet_scale_ * dihedral_sine(x, tet.a, tet.b, tet.c));
    }
    for (const auto& triangle : triangles_) {
        least = std::min(least, kTriangleScale * angle_sine(x, triangle.from, triangle.to));
    }
    return least;
}

void Star::sines(const Vec3& x, std::vector<double>& values) const {
    values.clear();
    for (const auto& tet : tets_) {
        values.push_back(tet_scale_ * dihedral_sine(x, tet.a, tet.b, tet.c));
    }
    for (const auto& triangle : triangles_) {
        values.push_back(kTriangleScale * angle_sine(x, triangle.from, triangle.to));
    }
}

}  // namespace remesh::improve
