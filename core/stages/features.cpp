#include "core/stages/features.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "core/error.h"
#include "core/geometry/bvh.h"
#include "core/geometry/edge_table.h"
#include "core/number_text.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr double kConsistentDensity = 0.35;  // Sharp-edge density below which edges are features,
constexpr double kCoarseEdge = 2.5;          // or mean edge over h above which they are.
constexpr double kTipDeficit = 1.2;          // Missing angle around a point-like tip, radians.
constexpr double kShortCurve = 2.0;          // Times h: sets whose curves are shorter are noise.
constexpr double kFreeEnd = 2.0;             // Sets with an end in the open must be so much longer.
constexpr double kBeyondRim = 0.6;           // Of h: where the other side of a seam is looked for.

double cosine_of(double degrees) {
    return std::cos(degrees * std::numbers::pi / 180.0);
}

class FeatureFinder {
public:
    FeatureFinder(const PrepareResult& prepared, double h, const FeatureOptions& options,
                  RunContext& run)
        : surface_(prepared.cleaned),
          domain_(*prepared.domain),
          h_(h),
          options_(options),
          run_(run),
          table_(surface_.triangles, surface_.vertices.size()) {}

    FeatureSet find() {
        find_sharp_edges();
        build_adjacency();
        mark_corners();
        drop_noise();
        build_adjacency();
        mark_corners();
        collect_corners();
        chain();
        find_tips();
        return std::move(result_);
    }

private:
    struct Segment {
        Index a;
        Index b;
    };

    [[nodiscard]] const Vec3& at(Index v) const {
        return surface_.vertices[static_cast<std::size_t>(v)];
    }

    [[nodiscard]] Vec3 normal(EdgeTable::HalfEdge half) const {
        return area_vector(surface_, EdgeTable::triangle_of(half)).normalized();
    }

    [[nodiscard]] bool is_on_boundary(const Vec3& point) const {
        return domain_.closest_within(point, kOffBoundary * h_).has_value();
    }

    void find_sharp_edges() {
        for (const auto& edge : table_.edges()) {
            const Vec3 middle = 0.5 * (at(edge.low) + at(edge.high));
            if (is_sharp(edge) && is_on_boundary(middle) && is_on_boundary(at(edge.low)) &&
                is_on_boundary(at(edge.high))) {
                segments_.push_back({edge.low, edge.high});
            }
        }
        run_.checkpoint();
    }

    [[nodiscard]] bool is_sharp(const EdgeTable::Edge& edge) {
        const auto halves = table_.half_edges(edge);
        if (edge.count == 1) {
            return is_sharp_rim(halves[0]);
        }
        return edge.count > 2 ||
               normal(halves[0]).dot(normal(halves[1])) < cosine_of(options_.sharp_angle);
    }

    /// Whether the input goes on beyond an open rim (a seam that doesn't join) and bends there.
    [[nodiscard]] bool is_sharp_rim(EdgeTable::HalfEdge half) {
        if (bvh_.empty()) {
            bvh_ = Bvh(surface_.vertices, surface_.triangles);
        }
        const Vec3& a = at(start_of(surface_.triangles, half));
        const Vec3& b = at(end_of(surface_.triangles, half));
        const Vec3 n = normal(half);
        const Vec3 away = (b - a).normalized().cross(n);
        const auto beyond = domain_.closest(0.5 * (a + b) + kBeyondRim * h_ * away);
        const double reach = kOffBoundary * h_;
        return bvh_.closest(beyond.point, reach * reach).has_value() &&
               n.dot(beyond.normal) < cosine_of(options_.sharp_angle);
    }

    /// Connected sets that are short, or of short curves between corners, aren't features. A crease
    /// that fades out, as on a smooth organ, is less likely one than an edge that closes or joins.
    void drop_noise() {
        DisjointSets sets(surface_.vertices.size());
        is_sharp_vertex_.assign(surface_.vertices.size(), 0);
        for (const Segment& s : segments_) {
            sets.merge(s.a, s.b);
            is_sharp_vertex_[static_cast<std::size_t>(s.a)] = 1;
            is_sharp_vertex_[static_cast<std::size_t>(s.b)] = 1;
        }
        const auto set_of = [&](Index v) { return static_cast<std::size_t>(sets.find(v)); };
        std::vector<double> length(surface_.vertices.size(), 0.0);
        std::vector<double> curves(surface_.vertices.size(), 0.0);
        std::vector<double> needed(surface_.vertices.size(), 1.0);  // Of the shortest length.
        for (const Segment& s : segments_) {
            length[set_of(s.a)] += (at(s.a) - at(s.b)).norm();
        }
        for (std::size_t i = 0; i < is_corner_.size(); ++i) {
            const auto v = static_cast<Index>(i);
            curves[set_of(v)] += is_corner_[i] ? 0.5 * static_cast<double>(degree(v)) : 0.0;
            needed[set_of(v)] *= degree(v) == 1 ? kFreeEnd : 1.0;
        }
        std::erase_if(segments_, [&](const Segment& s) {
            const std::size_t set = set_of(s.a);
            return length[set] < std::min(needed[set], kFreeEnd) * options_.min_length * h_ ||
                   length[set] < kShortCurve * h_ * curves[set];
        });
    }

    void build_adjacency() {
        first_.assign(surface_.vertices.size() + 1, 0);
        for (const Segment& s : segments_) {
            ++first_[static_cast<std::size_t>(s.a) + 1];
            ++first_[static_cast<std::size_t>(s.b) + 1];
        }
        for (std::size_t i = 1; i < first_.size(); ++i) {
            first_[i] += first_[i - 1];
        }
        incident_.resize(2 * segments_.size());
        auto next = first_;
        for (std::size_t i = 0; i < segments_.size(); ++i) {
            for (const Index v : {segments_[i].a, segments_[i].b}) {
                auto& slot = next[static_cast<std::size_t>(v)];
                incident_[static_cast<std::size_t>(slot++)] = static_cast<Index>(i);
            }
        }
        is_used_.assign(segments_.size(), 0);
    }

    [[nodiscard]] std::size_t degree(Index v) const {
        const auto i = static_cast<std::size_t>(v);
        return static_cast<std::size_t>(first_[i + 1] - first_[i]);
    }
    [[nodiscard]] Index segment(Index v, std::size_t k) const {
        return incident_[static_cast<std::size_t>(first_[static_cast<std::size_t>(v)]) + k];
    }
    [[nodiscard]] Index other_end(Index s, Index v) const {
        const Segment& segment = segments_[static_cast<std::size_t>(s)];
        return segment.a == v ? segment.b : segment.a;
    }

    void mark_corners() {
        is_corner_.assign(surface_.vertices.size(), 0);
        for (std::size_t i = 0; i < surface_.vertices.size(); ++i) {
            const auto v = static_cast<Index>(i);
            if (degree(v) == 0) {
                continue;
            }
            bool corner = degree(v) != 2;
            if (!corner) {
                const Vec3 in = (at(v) - at(other_end(segment(v, 0), v))).normalized();
                const Vec3 out = (at(other_end(segment(v, 1), v)) - at(v)).normalized();
                corner = in.dot(out) < cosine_of(options_.corner_angle);
            }
            is_corner_[i] = corner;
        }
    }

    void collect_corners() {
        for (std::size_t i = 0; i < is_corner_.size(); ++i) {
            if (is_corner_[i]) {
                result_.corners.push_back(surface_.vertices[i]);
            }
        }
    }

    /// Curves from corner to corner first; what is left runs in circles without one.
    void chain() {
        for (const bool from_corners : {true, false}) {
            for (std::size_t i = 0; i < surface_.vertices.size(); ++i) {
                if (from_corners && !is_corner_[i]) {
                    continue;
                }
                const auto v = static_cast<Index>(i);
                for (std::size_t k = 0; k < degree(v); ++k) {
                    if (!is_used_[static_cast<std::size_t>(segment(v, k))]) {
                        result_.curves.push_back(walk(v, segment(v, k)));
                    }
                }
            }
        }
    }

    FeatureCurve walk(Index start, Index first_segment) {
        FeatureCurve curve;
        curve.points.push_back(at(start));
        Index v = start;
        Index s = first_segment;
        for (;;) {
            is_used_[static_cast<std::size_t>(s)] = 1;
            v = other_end(s, v);
            curve.points.push_back(at(v));
            if (v == start || is_corner_[static_cast<std::size_t>(v)]) {
                break;
            }
            s = segment(v, 0) == s ? segment(v, 1) : segment(v, 0);
        }
        curve.is_closed = v == start;
        return curve;
    }

    /// Vertices like the apex of a cone: closed around, no sharp edge, and little angle.
    void find_tips() {
        const std::size_t n = surface_.vertices.size();
        std::vector<double> angle(n, 0.0);
        for (const Triangle& t : surface_.triangles) {
            for (std::size_t k = 0; k < 3; ++k) {
                const Vec3 u = at(t[(k + 1) % 3]) - at(t[k]);
                const Vec3 v = at(t[(k + 2) % 3]) - at(t[k]);
                angle[static_cast<std::size_t>(t[k])] += std::atan2(u.cross(v).norm(), u.dot(v));
            }
        }
        std::vector<char> is_open(n, 0);
        for (const auto& edge : table_.edges()) {
            if (edge.count != 2) {
                is_open[static_cast<std::size_t>(edge.low)] = 1;
                is_open[static_cast<std::size_t>(edge.high)] = 1;
            }
        }
        for (std::size_t i = 0; i < n; ++i) {
            const auto v = static_cast<Index>(i);
            if (!is_sharp_vertex_[i] && !is_open[i] &&
                2.0 * std::numbers::pi - angle[i] > kTipDeficit && is_on_boundary(at(v))) {
                result_.corners.push_back(at(v));
            }
        }
    }

    const SurfaceMesh& surface_;
    const Domain& domain_;
    double h_;
    const FeatureOptions& options_;
    RunContext& run_;
    EdgeTable table_;
    Bvh bvh_;  // Of the input; made when there is an open rim.
    std::vector<Segment> segments_;
    std::vector<std::int32_t> first_;  // Segments at vertex v: incident_[first_[v] .. first_[v+1]).
    std::vector<Index> incident_;
    std::vector<char> is_used_;
    std::vector<char> is_corner_;
    std::vector<char> is_sharp_vertex_;  // Before noise was dropped.
    FeatureSet result_;
};

void require(bool ok, const std::string& field, const std::string& range, double value) {
    if (!ok) {
        throw Error(ErrorCode::InvalidInput,
                    "features." + field + " must be in " + range + ", got " + number_text(value));
    }
}

}  // namespace

CurvePoint closest_on_curve(const FeatureCurve& curve, const Vec3& point) {
    CurvePoint best;
    double best2 = std::numeric_limits<double>::infinity();
    double arc = 0.0;
    for (std::size_t i = 0; i + 1 < curve.points.size(); ++i) {
        const Vec3 along = curve.points[i + 1] - curve.points[i];
        const double length2 = along.squaredNorm();
        const double length = std::sqrt(length2);
        if (length2 > 0.0) {
            const double t = std::clamp((point - curve.points[i]).dot(along) / length2, 0.0, 1.0);
            const Vec3 candidate = curve.points[i] + t * along;
            const double distance2 = (candidate - point).squaredNorm();
            if (distance2 < best2) {
                best2 = distance2;
                best = {candidate, along / length, arc + t * length};
            }
        }
        arc += length;
    }
    return best;
}

void validate(const FeatureOptions& options) {
    require(options.sharp_angle > 0.0 && options.sharp_angle < 180.0, "sharp_angle", "(0, 180)",
            options.sharp_angle);
    require(options.corner_angle > 0.0 && options.corner_angle < 180.0, "corner_angle", "(0, 180)",
            options.corner_angle);
    require(options.min_length >= 0.0 && std::isfinite(options.min_length), "min_length",
            "[0, infinity)", options.min_length);
}

FeatureSet find_features(const PrepareResult& prepared, double h, const FeatureOptions& options,
                         RunContext& run) {
    validate(options);
    const auto& facts = prepared.facts;
    const bool is_consistent =
        facts.sharp_edge_density < kConsistentDensity || facts.mean_edge > kCoarseEdge * h;
    if (!options.detect || prepared.smoothed || !is_consistent) {
        return {};
    }
    return FeatureFinder(prepared, h, options, run).find();
}

}  // namespace remesh
