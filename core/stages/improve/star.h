#pragma once

#include <vector>

#include "core/stages/improve/live_mesh.h"

namespace remesh::improve {

/// Energy of all that touches one vertex, as a function of where that vertex is.
///
/// Sum of phi^p over its tets, phi = sum(l^2) / (12 (3V)^(2/3)), plus w times the sum of the 2-D
/// sibling over its boundary triangles, sum(l^2) / (4 sqrt(3) A); 1 for regular ones.
class Star {
public:
    Star(double power, double surface_weight) : power_(power), surface_weight_(surface_weight) {}

    /// Takes the tets around a vertex, and its boundary triangles unless it is a volume vertex.
    void gather(const LiveMesh& mesh, Index v);

    /// Infinite where a tet is inverted or flat.
    [[nodiscard]] double energy(const Vec3& x) const;
    /// Smallest 6V / l^3 of the tets; the energy is infinite where it isn't above `kFlat`.
    [[nodiscard]] double flatness(const Vec3& x) const;

    struct Model {
        double energy = 0.0;
        Vec3 gradient = Vec3::Zero();
        Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    };
    /// Value and derivatives. Volumes are shifted up by `lift` * l^3 so that flat and inverted tets
    /// have a finite energy too.
    [[nodiscard]] Model model(const Vec3& x, double lift) const;
    [[nodiscard]] double lifted_energy(const Vec3& x, double lift) const;

    /// Sum of the outward normals of the boundary triangles, weighted by area.
    [[nodiscard]] Vec3 fan_normal(const Vec3& x) const;
    /// Smallest cosine between the normal of a boundary triangle and the mean of all; 1 for volume
    /// vertices.
    [[nodiscard]] double fan_cosine(const Vec3& x) const;
    /// Whether a move from one place to another folds the boundary over.
    [[nodiscard]] bool folds(const Vec3& from, const Vec3& to) const;
    /// Mean length of the edges at the vertex.
    [[nodiscard]] double edge_length(const Vec3& x) const;
    [[nodiscard]] bool empty() const { return tets_.empty(); }

    /// Worst dihedral sine of the tets, times LiveMesh::tet_scale, and angle sine of the triangles,
    /// times kTriangleScale.
    [[nodiscard]] double worst(const Vec3& x) const;

    /// The same of each of them, tets first. `values` is replaced.
    void sines(const Vec3& x, std::vector<double>& values) const;

    static constexpr double kFlat = 1e-6;

private:
    struct Opposite {
        Vec3 a;  // The tet (x, a, b, c) is positively oriented.
        Vec3 b;
        Vec3 c;
    };
    struct Edge {
        Vec3 from;
        Vec3 to;
    };
    [[nodiscard]] double raised(double cubed) const;

    double power_;
    double surface_weight_;
    double tet_scale_ = 1.0;
    std::vector<Opposite> tets_;
    std::vector<Edge> triangles_;
    std::vector<LinkEdge> fan_;
};

}  // namespace remesh::improve
