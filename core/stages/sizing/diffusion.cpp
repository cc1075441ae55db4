#include "core/stages/sizing/diffusion.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>

#include <array>
#include <cmath>

#include "core/mesh/index.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kFlat = 1e-3;  // Volume over that of a regular tet of the same mean squared edge.
constexpr double kTolerance = 1e-6;
constexpr int kIterations = 50;  // Between two looks whether to stop.
constexpr int kRounds = 40;      // A few are enough; what is left then is good enough for sizes.

// What one tet adds to the equations.
struct Element {
    double volume = 0.0;             // 0 if it is flat.
    std::array<Vec3, 4> gradient{};  // Of the corners' hat functions.
};

Element element_of(const Tet& tet, const Points& points) {
    const Vec3& a = points[at(tet[0])];
    const Vec3 u = points[at(tet[1])] - a;
    const Vec3 v = points[at(tet[2])] - a;
    const Vec3 w = points[at(tet[3])] - a;
    const double six_volumes = u.dot(v.cross(w));
    const double squared = (u.squaredNorm() + v.squaredNorm() + w.squaredNorm() +
                            (u - v).squaredNorm() + (v - w).squaredNorm() + (w - u).squaredNorm()) /
                           6.0;
    Element element;
    if (six_volumes <= kFlat * squared * std::sqrt(0.5 * squared)) {
        return element;
    }
    element.volume = six_volumes / 6.0;
    element.gradient[1] = v.cross(w) / six_volumes;
    element.gradient[2] = w.cross(u) / six_volumes;
    element.gradient[3] = u.cross(v) / six_volumes;
    element.gradient[0] = -(element.gradient[1] + element.gradient[2] + element.gradient[3]);
    return element;
}

}  // namespace

std::vector<double> diffuse(const Points& points, const std::vector<Tet>& tets,
                            std::vector<double> c, const std::vector<char>& is_fixed,
                            const DiffusionOptions& options, const RunContext& run) {
    std::vector<Index> row(points.size(), kNone);  // Of the unknown at a point.
    std::vector<Index> unknowns;
    for (const Tet& tet : tets) {
        for (const Index i : tet) {
            if (is_fixed[at(i)] == 0 && row[at(i)] == kNone) {
                row[at(i)] = static_cast<Index>(unknowns.size());
                unknowns.push_back(i);
            }
        }
    }
    const auto n = static_cast<Eigen::Index>(unknowns.size());

    // (M / time + K - R M) c = M / time c_before, with K the stiffness and M the lumped mass.
    const double per_time = 1.0 / options.time;
    Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(n);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
    std::vector<Eigen::Triplet<double>> entries;  // Below the diagonal.
    entries.reserve(6 * tets.size() + unknowns.size());
    for (std::size_t t = 0; t < tets.size(); ++t) {
        if (t % kGrain == 0) {
            run.checkpoint();
        }
        const Element element = element_of(tets[t], points);
        const double mass = 0.25 * element.volume;
        for (std::size_t p = 0; p < 4 && element.volume > 0.0; ++p) {
            const Index i = row[at(tets[t][p])];
            if (i == kNone) {
                continue;
            }
            diagonal[i] += element.volume * element.gradient[p].squaredNorm() +
                           mass * (per_time - options.reaction);
            right[i] += mass * per_time * c[at(tets[t][p])];
            for (std::size_t q = 0; q < 4; ++q) {
                const Index j = row[at(tets[t][q])];
                const double stiffness =
                    element.volume * element.gradient[p].dot(element.gradient[q]);
                if (j == kNone) {
                    right[i] -= stiffness * c[at(tets[t][q])];
                } else if (j < i) {
                    entries.emplace_back(i, j, stiffness);
                }
            }
        }
    }
    for (Eigen::Index i = 0; i < n; ++i) {
        if (diagonal[i] == 0.0) {  // In flat tets only.
            diagonal[i] = 1.0;
            right[i] = c[at(unknowns[static_cast<std::size_t>(i)])];
        }
        entries.emplace_back(i, i, diagonal[i]);
    }
    Eigen::SparseMatrix<double> matrix(n, n);
    matrix.setFromTriplets(entries.begin(), entries.end());
    entries = {};

    Eigen::VectorXd values(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        values[i] = c[at(unknowns[static_cast<std::size_t>(i)])];
    }
    Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower> solver;
    solver.setTolerance(kTolerance);
    solver.setMaxIterations(kIterations);
    solver.compute(matrix);
    for (int round = 0; round < kRounds; ++round) {
        run.checkpoint();
        values = solver.solveWithGuess(right, values);
        if (solver.info() == Eigen::Success) {
            break;
        }
    }
    for (Eigen::Index i = 0; i < n; ++i) {
        c[at(unknowns[static_cast<std::size_t>(i)])] = values[i];
    }
    return c;
}

}  // namespace remesh
