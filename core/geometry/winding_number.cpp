#include "core/geometry/winding_number.h"

#include <cmath>
#include <numbers>

namespace remesh {
namespace {

constexpr float kBeta = 2.0F;
constexpr float kPiF = std::numbers::pi_v<float>;

// Far from everything, so that an unused lane adds nothing and is never entered.
constexpr float kNowhere = 64.0F;

/// What a group of triangles looks like from afar, in tree units.
struct Moments {
    Vec3 weighted = Vec3::Zero();  // Sum of |area| * centroid.
    double weight = 0.0;           // Sum of |area|.
    Vec3 area = Vec3::Zero();
    Eigen::Matrix3d first = Eigen::Matrix3d::Zero();  // Sum of centroid * area^T, about the origin.

    void add(const Moments& other) {
        weighted += other.weighted;
        weight += other.weight;
        area += other.area;
        first += other.first;
    }
};

// To 2e-6; its own polynomial, since a library's may differ from machine to machine.
Lanes atan2_lanes(const Lanes& y, const Lanes& x) {
    const Lanes ax = x.abs();
    const Lanes ay = y.abs();
    const Lanes larger = ax.max(ay);
    const Lanes ratio = ax.min(ay) / larger.max(1e-37F);
    const Lanes s = ratio * ratio;
    Lanes angle =
        ratio *
        (0.99997726F +
         s * (-0.33262347F +
              s * (0.19354346F + s * (-0.11643287F + s * (0.05265332F - s * 0.01172120F)))));
    angle = (ay > ax).select(0.5F * kPiF - angle, angle);
    angle = (x < 0.0F).select(kPiF - angle, angle);
    return (y < 0.0F).select(-angle, angle);
}

using Vec3Lanes = std::array<Lanes, 3>;

Lanes dot(const Vec3Lanes& a, const Vec3Lanes& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Fills a winding tree from a tree of boxes, children before parents.
class Filler {
public:
    Filler(const WideTree& boxes, const Points& vertices, const std::vector<Triangle>& triangles,
           WindingTree& tree)
        : boxes_(boxes), vertices_(vertices), triangles_(triangles), tree_(tree) {}

    void fill() {
        tree_.center = boxes_.center;
        tree_.scale = boxes_.scale;
        tree_.nodes.resize(boxes_.nodes.size());
        tree_.leaves.resize(boxes_.leaf_begin.size() - 1);
        std::vector<Moments> of_node(boxes_.nodes.size());
        for (std::size_t i = boxes_.nodes.size(); i-- > 0;) {
            const auto& from = boxes_.nodes[i];
            auto& to = tree_.nodes[i];
            to.child = from.child;
            for (std::size_t k = 0; k < 4; ++k) {
                if (from.child[k] == WideTree::kEmpty) {
                    set_nowhere(to, k);
                    continue;
                }
                const Moments moments = from.child[k] < 0
                                            ? fill_leaf(static_cast<std::size_t>(~from.child[k]))
                                            : of_node[static_cast<std::size_t>(from.child[k])];
                set_lane(to, from, k, moments);
                of_node[i].add(moments);
            }
        }
    }

private:
    [[nodiscard]] Vec3 corner(Index triangle, std::size_t k) const {
        const Index v = triangles_[static_cast<std::size_t>(triangle)][k];
        return (vertices_[static_cast<std::size_t>(v)] - boxes_.center) * boxes_.scale;
    }

    Moments fill_leaf(std::size_t leaf) {
        Moments moments;
        auto& to = tree_.leaves[leaf];
        for (auto& axes : to.corner) {
            axes.fill(Lanes::Constant(kNowhere));
        }
        Eigen::Index lane = 0;
        for (std::int32_t s = boxes_.leaf_begin[leaf]; s != boxes_.leaf_begin[leaf + 1]; ++s) {
            const Index triangle = boxes_.order[static_cast<std::size_t>(s)];
            const Vec3 a = corner(triangle, 0);
            const Vec3 b = corner(triangle, 1);
            const Vec3 c = corner(triangle, 2);
            for (std::size_t d = 0; d < 3; ++d) {
                const auto e = static_cast<Eigen::Index>(d);
                to.corner[0][d][lane] = static_cast<float>(a[e]);
                to.corner[1][d][lane] = static_cast<float>(b[e]);
                to.corner[2][d][lane] = static_cast<float>(c[e]);
            }
            ++lane;
            Moments one;
            const Vec3 centroid = (a + b + c) / 3.0;
            one.area = 0.5 * (b - a).cross(c - a);
            one.weight = one.area.norm();
            one.weighted = one.weight * centroid;
            one.first = centroid * one.area.transpose();
            moments.add(one);
        }
        return moments;
    }

    static void set_nowhere(WindingTree::Node& node, std::size_t k) {
        const auto lane = static_cast<Eigen::Index>(k);
        for (std::size_t d = 0; d < 3; ++d) {
            node.center[d][lane] = kNowhere;
            node.area[d][lane] = 0.0F;
        }
        for (auto& moment : node.moment) {
            moment[lane] = 0.0F;
        }
        node.trace[lane] = 0.0F;
        node.radius[lane] = 0.0F;
    }

    static void set_lane(WindingTree::Node& node, const WideTree::Node& box, std::size_t k,
                         const Moments& moments) {
        const auto lane = static_cast<Eigen::Index>(k);
        Vec3 low;
        Vec3 high;
        for (std::size_t d = 0; d < 3; ++d) {
            low[static_cast<Eigen::Index>(d)] = static_cast<double>(box.low[d][lane]);
            high[static_cast<Eigen::Index>(d)] = static_cast<double>(box.high[d][lane]);
        }
        const Vec3 center = moments.weight > 0.0 ? Vec3(moments.weighted / moments.weight)
                                                 : Vec3(0.5 * (low + high));
        const Eigen::Matrix3d first = moments.first - center * moments.area.transpose();
        for (std::size_t d = 0; d < 3; ++d) {
            const auto e = static_cast<Eigen::Index>(d);
            node.center[d][lane] = static_cast<float>(center[e]);
            node.area[d][lane] = static_cast<float>(moments.area[e]);
            node.moment[d][lane] = static_cast<float>(first(e, e));
        }
        node.moment[3][lane] = static_cast<float>(0.5 * (first(0, 1) + first(1, 0)));
        node.moment[4][lane] = static_cast<float>(0.5 * (first(0, 2) + first(2, 0)));
        node.moment[5][lane] = static_cast<float>(0.5 * (first(1, 2) + first(2, 1)));
        node.trace[lane] = static_cast<float>(first.trace());
        node.radius[lane] = static_cast<float>((center - low).cwiseMax(high - center).norm());
    }

    const WideTree& boxes_;
    const Points& vertices_;
    const std::vector<Triangle>& triangles_;
    WindingTree& tree_;
};

}  // namespace

double solid_angle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 u = a - p;
    const Vec3 v = b - p;
    const Vec3 w = c - p;
    const double lu = u.norm();
    const double lv = v.norm();
    const double lw = w.norm();
    const double numerator = u.dot(v.cross(w));
    const double denominator = lu * lv * lw + u.dot(v) * lw + v.dot(w) * lu + w.dot(u) * lv;
    return 2.0 * std::atan2(numerator, denominator);
}

float WindingTree::half_solid_angles(const Leaf& leaf, const Eigen::Vector3f& p) {
    std::array<Vec3Lanes, 3> x;
    std::array<Lanes, 3> length;
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t d = 0; d < 3; ++d) {
            x[i][d] = leaf.corner[i][d] - p[static_cast<Eigen::Index>(d)];
        }
        length[i] = dot(x[i], x[i]).sqrt();
    }
    const Vec3Lanes cross{x[1][1] * x[2][2] - x[1][2] * x[2][1],
                          x[1][2] * x[2][0] - x[1][0] * x[2][2],
                          x[1][0] * x[2][1] - x[1][1] * x[2][0]};
    const Lanes numerator = dot(x[0], cross);
    const Lanes denominator = length[0] * length[1] * length[2] + dot(x[0], x[1]) * length[2] +
                              dot(x[1], x[2]) * length[0] + dot(x[2], x[0]) * length[1];
    return atan2_lanes(numerator, denominator).sum();
}

WindingNumber::WindingNumber(const Points& vertices, const std::vector<Triangle>& triangles) {
    const WideTree boxes = build_wide_tree(vertices, triangles);
    Filler(boxes, vertices, triangles, tree_).fill();
}

double WindingNumber::at(const Vec3& point) const {
    if (tree_.nodes.empty()) {
        return 0.0;
    }
    const Eigen::Vector3f p = ((point - tree_.center) * tree_.scale).cast<float>();
    Lanes far_sum = Lanes::Zero();
    float half_angles = 0.0F;
    std::array<std::int32_t, WideTree::kMaxStack> stack;
    std::size_t top = 0;
    stack[top++] = 0;
    while (top > 0) {
        const auto& node = tree_.nodes[static_cast<std::size_t>(stack[--top])];
        const Vec3Lanes d{node.center[0] - p[0], node.center[1] - p[1], node.center[2] - p[2]};
        const Lanes distance2 = dot(d, d);
        const auto is_far = (distance2 > kBeta * kBeta * node.radius * node.radius).eval();
        far_sum += is_far.select(WindingTree::far_terms(node, d, distance2), 0.0F);
        for (std::size_t k = 0; k < 4; ++k) {
            if (is_far[static_cast<Eigen::Index>(k)]) {
                continue;
            }
            if (node.child[k] >= 0) {
                stack[top++] = node.child[k];
            } else {
                const auto leaf = static_cast<std::size_t>(~node.child[k]);
                half_angles += WindingTree::half_solid_angles(tree_.leaves[leaf], p);
            }
        }
    }
    const auto sum = static_cast<double>(far_sum.sum());
    return (sum + 2.0 * static_cast<double>(half_angles)) / (4.0 * std::numbers::pi);
}

}  // namespace remesh
