#include "core/stages/orient_sheets.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/geometry/winding_number.h"
#include "core/parallel.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr std::size_t kSamples = 60;  // A part.
constexpr double kSelfMade = 0.4;  // A part with a higher w of its own, on itself, isn't a sheet.
constexpr double kAside = 1e-3;    // Of a triangle's size: how far from it w is asked for.

/// The misfit of signs s: sum over the samples of area (sum_j s_j a_j - 1/2)^2, where a_j is part
/// j's winding number on the surface there. It's s^T A s - 2 b^T s, but for a constant.
class Misfit {
public:
    Misfit(const SurfaceMesh& surface, const std::vector<const std::vector<Index>*>& parts,
           RunContext& run)
        : a_(Eigen::MatrixXd::Zero(size(parts), size(parts))),
          b_(Eigen::VectorXd::Zero(size(parts))),
          self_(Eigen::VectorXd::Zero(size(parts))) {
        std::vector<WindingNumber> winding;
        for (const auto* part : parts) {
            std::vector<Triangle> triangles;
            for (const Index i : *part) {
                triangles.push_back(surface.triangles[static_cast<std::size_t>(i)]);
            }
            winding.emplace_back(surface.vertices, triangles);
        }
        for (std::size_t p = 0; p < parts.size(); ++p) {
            run.checkpoint();
            add_samples(surface, *parts[p], static_cast<Eigen::Index>(p), winding);
        }
    }

    [[nodiscard]] double of(const Eigen::VectorXd& signs) const {
        return signs.dot(a_ * signs) - 2.0 * b_.dot(signs);
    }

    /// How much it grows when sign k turns.
    [[nodiscard]] double change(const Eigen::VectorXd& signs, Eigen::Index k) const {
        const double others = a_.row(k).dot(signs) - a_(k, k) * signs[k];
        return 4.0 * signs[k] * (b_[k] - others);
    }

    /// w that a part makes on itself.
    [[nodiscard]] double self(Eigen::Index k) const { return self_[k]; }

private:
    static Eigen::Index size(const std::vector<const std::vector<Index>*>& parts) {
        return static_cast<Eigen::Index>(parts.size());
    }

    void add_samples(const SurfaceMesh& surface, const std::vector<Index>& part, Eigen::Index own,
                     const std::vector<WindingNumber>& winding) {
        const std::size_t step = std::max<std::size_t>(1, part.size() / kSamples);
        double weight = 0.0;
        for (std::size_t q = 0; q < part.size(); q += step) {
            const auto i = static_cast<std::size_t>(part[q]);
            const Vec3 area = area_vector(surface, i);
            const Vec3 aside = kAside * area / std::sqrt(area.norm());
            const Vec3 middle = centroid(surface, i);
            Eigen::VectorXd w(static_cast<Eigen::Index>(winding.size()));
            for (std::size_t j = 0; j < winding.size(); ++j) {
                w[static_cast<Eigen::Index>(j)] =
                    0.5 * (winding[j].at(middle + aside) + winding[j].at(middle - aside));
            }
            a_ += area.norm() * w * w.transpose();
            b_ += 0.5 * area.norm() * w;
            self_[own] += area.norm() * w[own];
            weight += area.norm();
        }
        self_[own] /= weight;
    }

    Eigen::MatrixXd a_;
    Eigen::VectorXd b_;
    Eigen::VectorXd self_;
};

/// Turns one part after the other as long as that helps.
void descend(const Misfit& misfit, const std::vector<char>& is_sheet, Eigen::VectorXd& signs) {
    for (bool any = true; any;) {
        any = false;
        for (Eigen::Index k = 0; k < signs.size(); ++k) {
            if (is_sheet[static_cast<std::size_t>(k)] &&
                misfit.change(signs, k) < -1e-9 * std::abs(misfit.of(signs))) {
                signs[k] = -signs[k];
                any = true;
            }
        }
    }
}

}  // namespace

std::vector<char> find_turned_sheets(const SurfaceMesh& surface,
                                     const std::vector<const std::vector<Index>*>& parts,
                                     RunContext& run) {
    const Misfit misfit(surface, parts, run);
    std::vector<char> is_sheet;
    const auto n = static_cast<Eigen::Index>(parts.size());
    for (Eigen::Index k = 0; k < n; ++k) {
        is_sheet.push_back(std::abs(misfit.self(k)) < kSelfMade);
    }
    // A descent from what is there, and one from each neighbour of it.
    Eigen::VectorXd best = Eigen::VectorXd::Ones(n);
    descend(misfit, is_sheet, best);
    for (Eigen::Index k = 0; k < n; ++k) {
        run.checkpoint();
        if (is_sheet[static_cast<std::size_t>(k)]) {
            Eigen::VectorXd signs = Eigen::VectorXd::Ones(n);
            signs[k] = -1.0;
            descend(misfit, is_sheet, signs);
            if (misfit.of(signs) < misfit.of(best) - 1e-9 * std::abs(misfit.of(best))) {
                best = signs;
            }
        }
    }
    std::vector<char> turned;
    for (Eigen::Index k = 0; k < n; ++k) {
        turned.push_back(best[k] < 0.0);
    }
    return turned;
}

}  // namespace remesh
