#include "core/geometry/mollified_winding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace remesh {
namespace {

// A group is far beyond this many of its radii. More than the winding number itself needs: an
// error of it becomes roughness of the surface.
constexpr float kFar = 3.0F;
constexpr float kPointGroup = 0.15F;  // Groups smaller than this share of the kernel are points.
constexpr float kOnePoint = 0.12F;    // Likewise for a triangle,
constexpr float kThreePoints = 0.3F;  // for a triangle of three points
constexpr float kSixPoints = 0.6F;    // or six; larger ones are split.
constexpr int kMaxSplits = 7;

constexpr float kShape = 2.2F;  // Where the kernel turns negative; makes the second moment vanish.
constexpr float kNormal =
    1.0F / ((1.0F / 3.0F - 0.4F + 1.0F / 7.0F) - kShape * (0.2F - 2.0F / 7.0F + 1.0F / 9.0F));

using Vec3f = Eigen::Vector3f;

/// Sums what area elements near a point add to the field and its gradient.
///
/// Elements are kept until there are many: reading four numbers at once right after they were
/// written one by one would stall.
class NearSum {
public:
    explicit NearSum(float radius) : inverse_(1.0F / radius) {}

    /// \param offset  of the element from the point
    /// \param area    area vector of the element
    void add(const Vec3f& offset, const Vec3f& area) {
        const auto lane = static_cast<Eigen::Index>(count_ % 4);
        auto& pack = packs_[count_ / 4];
        for (std::size_t d = 0; d < 3; ++d) {
            pack.offset[d][lane] = offset[static_cast<Eigen::Index>(d)];
            pack.area[d][lane] = area[static_cast<Eigen::Index>(d)];
        }
        if (++count_ == 4 * kPacks) {
            flush();
        }
    }

    void finish() {
        while (count_ % 4 != 0) {
            add(Vec3f::Constant(2.0F / inverse_), Vec3f::Zero());
        }
        flush();
    }

    [[nodiscard]] float value() const { return inverse_ * inverse_ * value_.sum(); }
    [[nodiscard]] Vec3f gradient() const {
        return inverse_ * inverse_ * inverse_ *
               Vec3f(gradient_[0].sum(), gradient_[1].sum(), gradient_[2].sum());
    }

private:
    static constexpr std::size_t kPacks = 16;

    struct Pack {
        std::array<Lanes, 3> offset;
        std::array<Lanes, 3> area;
    };

    void flush() {
        for (std::size_t i = 0; i < count_ / 4; ++i) {
            sum(packs_[i]);
        }
        count_ = 0;
    }

    void sum(const Pack& pack) {
        const Lanes x = pack.offset[0] * inverse_;
        const Lanes y = pack.offset[1] * inverse_;
        const Lanes z = pack.offset[2] * inverse_;
        const Lanes u2 = x * x + y * y + z * z;
        const Lanes dipole = x * pack.area[0] + y * pack.area[1] + z * pack.area[2];
        // Share of the kernel within u, over u^3.
        const Lanes within =
            kNormal * ((1.0F / 3.0F - u2 * (0.4F - u2 * (1.0F / 7.0F))) -
                       kShape * u2 * (0.2F - u2 * (2.0F / 7.0F - u2 * (1.0F / 9.0F))));
        const auto is_beyond = (u2 >= 1.0F).eval();
        const Lanes inverse2 = 1.0F / u2.max(1.0F);
        value_ += dipole * is_beyond.select(inverse2 * inverse2.sqrt(), within);
        const Lanes rest = 1.0F - u2;
        const Lanes density = is_beyond.select(0.0F, kNormal * rest * rest * (1.0F - kShape * u2));
        for (std::size_t d = 0; d < 3; ++d) {
            gradient_[d] -= pack.area[d] * density;
        }
    }

    float inverse_;
    std::size_t count_ = 0;
    std::array<Pack, kPacks> packs_;
    Lanes value_ = Lanes::Zero();
    std::array<Lanes, 3> gradient_{Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
};

/// One evaluation, in tree units.
class Evaluation {
public:
    Evaluation(const WindingTree& tree, const Vec3f& point, float radius)
        : tree_(tree), point_(point), radius_(radius), near_(radius) {
        walk();
        near_.finish();
    }

    [[nodiscard]] double value() const {
        return static_cast<double>(far_.sum() + near_.value() + solid_angles_) /
               (4.0 * std::numbers::pi);
    }
    [[nodiscard]] Vec3 gradient() const {
        return near_.gradient().cast<double>() / (4.0 * std::numbers::pi);
    }

private:
    void walk() {
        std::array<std::int32_t, WideTree::kMaxStack> stack;
        std::size_t top = 0;
        stack[top++] = 0;
        while (top > 0) {
            const auto& node = tree_.nodes[static_cast<std::size_t>(stack[--top])];
            const std::array<Lanes, 3> d{node.center[0] - point_[0], node.center[1] - point_[1],
                                         node.center[2] - point_[2]};
            const Lanes distance2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            const Lanes limit = (kFar * node.radius).max(node.radius + radius_);
            const auto is_far = (distance2 > limit * limit).eval();
            far_ += is_far.select(WindingTree::far_terms(node, d, distance2), 0.0F);
            for (std::size_t k = 0; k < 4; ++k) {
                const auto lane = static_cast<Eigen::Index>(k);
                if (is_far[lane]) {
                    continue;
                }
                if (node.radius[lane] < kPointGroup * radius_) {
                    near_.add({d[0][lane], d[1][lane], d[2][lane]},
                              {node.area[0][lane], node.area[1][lane], node.area[2][lane]});
                } else if (node.child[k] >= 0) {
                    stack[top++] = node.child[k];
                } else {
                    add_leaf(tree_.leaves[static_cast<std::size_t>(~node.child[k])]);
                }
            }
        }
    }

    void add_leaf(const WindingTree::Leaf& leaf) {
        if (is_beyond(leaf)) {
            solid_angles_ += 2.0F * WindingTree::half_solid_angles(leaf, point_);
            return;
        }
        for (Eigen::Index lane = 0; lane < 4; ++lane) {
            const auto corner = [&](std::size_t k) {
                return Vec3f(leaf.corner[k][0][lane], leaf.corner[k][1][lane],
                             leaf.corner[k][2][lane]);
            };
            const Vec3f a = corner(0);
            const Vec3f b = corner(1);
            const Vec3f c = corner(2);
            if (a != b) {  // Spare lanes are points.
                add_triangle(a - point_, b - point_, c - point_, kMaxSplits);
            }
        }
    }

    /// Whether the kernel reaches none of a leaf's triangles.
    [[nodiscard]] bool is_beyond(const WindingTree::Leaf& leaf) const {
        std::array<Lanes, 3> middle;
        Lanes distance2 = Lanes::Zero();
        for (std::size_t d = 0; d < 3; ++d) {
            middle[d] = (leaf.corner[0][d] + leaf.corner[1][d] + leaf.corner[2][d]) * (1.0F / 3.0F);
            const Lanes offset = middle[d] - point_[static_cast<Eigen::Index>(d)];
            distance2 += offset * offset;
        }
        Lanes size2 = Lanes::Zero();
        for (const auto& corner : leaf.corner) {
            const Lanes x = corner[0] - middle[0];
            const Lanes y = corner[1] - middle[1];
            const Lanes z = corner[2] - middle[2];
            size2 = size2.max(x * x + y * y + z * z);
        }
        const Lanes limit = size2.sqrt() + radius_;
        return (distance2 > limit * limit).all();
    }

    void add_triangle(const Vec3f& a, const Vec3f& b, const Vec3f& c, int splits_left) {
        const Vec3f m = (a + b + c) / 3.0F;
        const float size2 =
            std::max({(a - m).squaredNorm(), (b - m).squaredNorm(), (c - m).squaredNorm()});
        const auto is_below = [&](float share) {
            return size2 < share * share * radius_ * radius_;
        };
        if (is_below(kSixPoints) || splits_left == 0) {
            const Vec3f area = 0.5F * (b - a).cross(c - a);
            if (is_below(kOnePoint)) {
                near_.add(m, area);
            } else if (is_below(kThreePoints)) {
                add_symmetric(a, b, c, 2.0F / 3.0F, area / 3.0F);
            } else {  // Exact to degree 4.
                add_symmetric(a, b, c, 0.108103018168070F, 0.223381589678011F * area);
                add_symmetric(a, b, c, 0.816847572980459F, 0.109951743655322F * area);
            }
            return;
        }
        const float limit = std::sqrt(size2) + radius_;
        if (m.squaredNorm() > limit * limit) {
            solid_angles_ += static_cast<float>(
                solid_angle(Vec3::Zero(), a.cast<double>(), b.cast<double>(), c.cast<double>()));
            return;
        }
        const Vec3f x = 0.5F * (a + b);
        const Vec3f y = 0.5F * (b + c);
        const Vec3f z = 0.5F * (c + a);
        add_triangle(a, x, z, splits_left - 1);
        add_triangle(x, b, y, splits_left - 1);
        add_triangle(z, y, c, splits_left - 1);
        add_triangle(x, y, z, splits_left - 1);
    }

    /// Three points whose weight is `share` at one corner and alike at the two others.
    void add_symmetric(const Vec3f& a, const Vec3f& b, const Vec3f& c, float share,
                       const Vec3f& area) {
        const float rest = 0.5F * (1.0F - share);
        const float lead = share - rest;
        const Vec3f base = rest * (a + b + c);
        near_.add(base + lead * a, area);
        near_.add(base + lead * b, area);
        near_.add(base + lead * c, area);
    }

    const WindingTree& tree_;
    Vec3f point_;
    float radius_;
    NearSum near_;
    Lanes far_ = Lanes::Zero();
    float solid_angles_ = 0.0F;
};

}  // namespace

MollifiedWinding::Sample MollifiedWinding::at(const Vec3& point, double radius) const {
    if (tree_.nodes.empty()) {
        return {};
    }
    const Evaluation evaluation(tree_, ((point - tree_.center) * tree_.scale).cast<float>(),
                                static_cast<float>(radius * tree_.scale));
    return {evaluation.value(), evaluation.gradient() * tree_.scale};
}

std::optional<MollifiedWinding::Projection> MollifiedWinding::project(const Vec3& point,
                                                                      const Sample& sample,
                                                                      double radius,
                                                                      double reach) const {
    constexpr int kSteps = 5;
    constexpr double kFlattest = 0.2;  // Least |gradient| times radius; about 1.5 on a plane.
    constexpr double kLongest = 0.3;   // Of the radius: longest step.
    constexpr double kSettled = 0.05;  // Of the radius: the next step would be far shorter still.
    Vec3 x = point;
    Sample here = sample;
    for (int k = 0; k < kSteps; ++k) {
        const double slope = here.gradient.norm();
        if (slope * radius < kFlattest) {
            return std::nullopt;
        }
        Vec3 step = here.gradient * ((0.5 - here.value) / (slope * slope));
        const double length = step.norm();
        if (length > kLongest * radius) {
            step *= kLongest * radius / length;
        }
        x += step;
        if ((x - point).norm() > reach) {
            return std::nullopt;
        }
        if (length < kSettled * radius) {
            return Projection{x, -here.gradient / slope};
        }
        here = at(x, radius);
    }
    return std::nullopt;
}

}  // namespace remesh
