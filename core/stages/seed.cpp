#include "core/stages/seed.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/geometry/curve_track.h"
#include "core/geometry/dart_grid.h"
#include "core/mesh/index.h"
#include "core/number_text.h"
#include "core/parallel.h"

namespace remesh {
namespace {

constexpr double kCornerSpacing = 0.35;  // Least distance of two corners over h.
constexpr double kCurveSpacing = 0.55;   // Least distance of a curve particle to others over h.
constexpr double kFeatureRadius = 0.85;  // Darts come this much closer to curves and corners.
constexpr double kTrianglesPerArea = 1.0 / 0.8660254037844386;  // Particles per h^2 of area.

// Every round throws one dart per particle wanted. Darts of a round are spread evenly, so that
// this few rounds fill the surface to one particle per 0.866 h^2 at the default radius.
constexpr int kRounds = 20;

void check_count(double count, const SeedOptions& options) {
    if (!(count <= static_cast<double>(options.max_particles))) {
        throw Error(ErrorCode::TooLarge,
                    "the edge length asks for about " + number_text(std::ceil(count)) +
                        " particles, more than seed.max_particles = " +
                        std::to_string(options.max_particles) + "; use a larger edge length");
    }
}

void seed_corners(const Domain& domain, const FeatureSet& features, const SizingField& sizing,
                  Particles& particles, DartGrid& grid) {
    for (const Vec3& corner : features.corners) {
        const double h = sizing.h(corner);
        const auto too_close = [&](Index, double squared, double mean_h) {
            return squared < std::pow(kCornerSpacing * mean_h, 2);
        };
        if (domain.closest_within(corner, kOffBoundary * h) &&
            !grid.has_conflict(corner, h, too_close)) {
            particles.add(corner, ParticleKind::Corner, kNone, h, Vec3::Zero());
            grid.add(corner, h);
        }
    }
}

// Arc lengths that cut a curve into pieces of equal integral of 1/h, the ends included.
std::vector<double> even_arcs(const CurveTrack& track, const SizingField& sizing) {
    const double step = sizing.is_uniform() ? track.length() : 0.1 * sizing.h_min();
    const auto steps = static_cast<std::size_t>(std::ceil(track.length() / step));
    std::vector<double> sum(steps + 1, 0.0);
    for (std::size_t k = 0; k < steps; ++k) {
        const double middle =
            track.length() * (static_cast<double>(k) + 0.5) / static_cast<double>(steps);
        sum[k + 1] =
            sum[k] + track.length() / static_cast<double>(steps) / sizing.h(track.at(middle).point);
    }
    const auto pieces = std::max<std::size_t>(static_cast<std::size_t>(std::lround(sum.back())),
                                              track.is_closed() ? 3 : 1);
    std::vector<double> arcs;
    for (std::size_t i = 0, k = 0; i <= pieces; ++i) {
        const double wanted = sum.back() * static_cast<double>(i) / static_cast<double>(pieces);
        while (k + 1 < steps && sum[k + 1] < wanted) {
            ++k;
        }
        const double share = (wanted - sum[k]) / (sum[k + 1] - sum[k]);
        arcs.push_back(track.length() * (static_cast<double>(k) + share) /
                       static_cast<double>(steps));
    }
    if (track.is_closed()) {
        arcs.pop_back();
    }
    return arcs;
}

void seed_curves(const Domain& domain, const FeatureSet& features, const SizingField& sizing,
                 Particles& particles, DartGrid& grid) {
    for (std::size_t c = 0; c < features.curves.size(); ++c) {
        const CurveTrack track(features.curves[c].points, features.curves[c].is_closed);
        if (!(track.length() > 0.0)) {
            continue;
        }
        for (const double arc : even_arcs(track, sizing)) {
            const CurveTrack::Place place = track.at(arc);
            const double h = sizing.h(place.point);
            const auto too_close = [&](Index, double squared, double) {
                return squared < std::pow(kCurveSpacing * h, 2);
            };
            if (domain.closest_within(place.point, kOffBoundary * h) &&
                !grid.has_conflict(place.point, h, too_close)) {
                particles.add(place.point, ParticleKind::Curve, static_cast<Index>(c), h,
                              place.tangent);
                grid.add(place.point, h);
            }
        }
    }
}

// A triangle a, a + u, a + v of the boundary, or a part of one.
struct Piece {
    Vec3 a;
    Vec3 u;
    Vec3 v;
    Index facet;
    double h;  // Lower bound of h on it.
};

Piece whole_facet(const SurfaceMesh& surface, std::size_t t, double h) {
    const Vec3& a = surface.vertices[at(surface.triangles[t][0])];
    const Vec3& b = surface.vertices[at(surface.triangles[t][1])];
    const Vec3& c = surface.vertices[at(surface.triangles[t][2])];
    return {a, b - a, c - a, static_cast<Index>(t), h};
}

// The boundary as a dart thrower sees it: pieces, and the share of the darts that each one gets.
class DartBoard {
public:
    DartBoard(const SurfaceMesh& surface, const SizingField& sizing, const RunContext& run)
        : surface_(surface), sizing_(sizing) {
        if (!sizing.is_uniform()) {
            cut(run);
        }
        until_.resize(sizing.is_uniform() ? surface.triangles.size() : pieces_.size());
        for_each_index(until_.size(), run, [&](std::size_t k) {
            const Piece p = piece(k);
            until_[k] = 0.5 * p.u.cross(p.v).norm() * kTrianglesPerArea / (p.h * p.h);
        });
        std::partial_sum(until_.begin(), until_.end(), until_.begin());
    }

    [[nodiscard]] std::size_t size() const { return until_.size(); }
    /// Particles wanted on pieces 0 to k.
    [[nodiscard]] double until(std::size_t k) const { return until_[k]; }
    /// First piece up to which at least `sum` particles are wanted, or the last one.
    [[nodiscard]] std::size_t piece_at(double sum) const {
        const auto found = std::lower_bound(until_.begin(), until_.end() - 1, sum);
        return static_cast<std::size_t>(found - until_.begin());
    }
    [[nodiscard]] double wanted() const { return until_.empty() ? 0.0 : until_.back(); }
    [[nodiscard]] Piece piece(std::size_t k) const {
        return pieces_.empty() ? whole_facet(surface_, k, sizing_.h_max()) : pieces_[k];
    }

private:
    static constexpr double kVaries = 0.8;  // Least over middle h above which a piece isn't cut.

    void cut(const RunContext& run) {
        const std::size_t n = surface_.triangles.size();
        std::vector<std::vector<Piece>> blocks((n + kGrain - 1) / kGrain);
        for_each_block(n, kGrain, run, [&](std::size_t begin, std::size_t end) {
            for (std::size_t t = begin; t < end; ++t) {
                cut(whole_facet(surface_, t, 0.0), blocks[begin / kGrain]);
            }
        });
        for (const auto& block : blocks) {
            pieces_.insert(pieces_.end(), block.begin(), block.end());
        }
    }

    void cut(Piece piece, std::vector<Piece>& pieces) const {
        const Vec3 step = (piece.u + piece.v) / 3.0;
        const double radius = std::sqrt(std::max(
            {step.squaredNorm(), (piece.u - step).squaredNorm(), (piece.v - step).squaredNorm()}));
        piece.h = sizing_.least_within(piece.a + step, radius);
        if (piece.h >= kVaries * sizing_.h(piece.a + step)) {
            pieces.push_back(piece);
            return;
        }
        const Vec3 u = 0.5 * piece.u;
        const Vec3 v = 0.5 * piece.v;
        cut({piece.a, u, v, piece.facet, 0.0}, pieces);
        cut({piece.a + u, u, v, piece.facet, 0.0}, pieces);
        cut({piece.a + v, u, v, piece.facet, 0.0}, pieces);
        cut({piece.a + u + v, -u, -v, piece.facet, 0.0}, pieces);
    }

    const SurfaceMesh& surface_;
    const SizingField& sizing_;
    std::vector<Piece> pieces_{};  // Empty where h is uniform: the facets themselves.
    std::vector<double> until_{};
};

class DartThrower {
public:
    DartThrower(const SizingField& sizing, const SeedOptions& options, Particles& particles,
                DartGrid& grid)
        : sizing_(sizing),
          options_(options),
          particles_(particles),
          grid_(grid),
          first_(particles.size()) {}

    // One dart for every particle wanted, each somewhere in its own equal share of the area. Those
    // that hit what was there before the round are sorted out side by side, the others in turn.
    void throw_round(const DartBoard& board, int round, const RunContext& run) {
        const auto darts = static_cast<std::size_t>(std::ceil(board.wanted()));
        const std::uint64_t seed =
            hash_bits(options_.seed * 64 + static_cast<std::uint64_t>(round));
        std::vector<std::vector<Dart>> blocks((darts + kGrain - 1) / kGrain);
        for_each_block(darts, kGrain, run, [&](std::size_t begin, std::size_t end) {
            const auto sum_at = [&](std::size_t dart) {
                return (static_cast<double>(dart) + hash_random(seed, dart, 0)) * board.wanted() /
                       static_cast<double>(darts);
            };
            std::size_t k = board.piece_at(sum_at(begin));
            for (std::size_t dart = begin; dart < end; ++dart) {
                while (k + 1 < board.size() && board.until(k) < sum_at(dart)) {
                    ++k;
                }
                const auto thrown = throw_dart(board.piece(k), seed, dart);
                if (thrown && !is_taken(*thrown)) {
                    blocks[begin / kGrain].push_back(*thrown);
                }
            }
        });
        for (const auto& block : blocks) {
            for (const Dart& dart : block) {
                if (!is_taken(dart)) {
                    particles_.add(dart.x, ParticleKind::Surface, dart.facet, dart.h, dart.normal);
                    grid_.add(dart.x, dart.h);
                }
            }
        }
    }

private:
    struct Dart {
        Vec3 x;
        Vec3 normal;
        double h;
        Index facet;
    };

    [[nodiscard]] std::optional<Dart> throw_dart(const Piece& piece, std::uint64_t seed,
                                                 std::uint64_t dart) const {
        const double root = std::sqrt(hash_random(seed, dart, 1));
        const double share = hash_random(seed, dart, 2);
        const Vec3 x = piece.a + root * (1.0 - share) * piece.u + root * share * piece.v;
        double h = sizing_.h_max();
        if (!sizing_.is_uniform()) {
            h = sizing_.h(x);
            // The board counts with the least h of the piece: thin out where h is larger.
            if (hash_random(seed, dart, 3) * h * h > piece.h * piece.h) {
                return {};
            }
        }
        return Dart{x, piece.u.cross(piece.v).normalized(), h, piece.facet};
    }

    [[nodiscard]] bool is_taken(const Dart& dart) const {
        return grid_.has_conflict(dart.x, dart.h, [&](Index j, double squared, double mean_h) {
            if (at(j) >= first_) {
                return squared < std::pow(options_.dart_radius * mean_h, 2) &&
                       particles_.normal[at(j)].dot(dart.normal) > kOpposed;
            }
            return squared < std::pow(kFeatureRadius * options_.dart_radius * mean_h, 2);
        });
    }

    const SizingField& sizing_;
    const SeedOptions& options_;
    Particles& particles_;
    DartGrid& grid_;
    std::size_t first_;  // Of the surface particles.
};

// Neighbours in space become neighbours in memory; kinds keep their order.
Particles in_spatial_order(const Particles& particles, std::size_t first, const Box& box) {
    const std::size_t n = particles.size();
    std::vector<std::pair<std::uint64_t, std::size_t>> order(n);
    for (std::size_t i = 0; i < n; ++i) {
        order[i] = {i < first ? 0 : morton_code(particles.position[i], box), i};
    }
    std::sort(order.begin() + static_cast<std::ptrdiff_t>(first), order.end());
    Particles sorted;
    for (const auto& [code, i] : order) {
        sorted.add(particles.position[i], particles.kind[i], particles.anchor[i], particles.h[i],
                   particles.normal[i]);
    }
    return sorted;
}

}  // namespace

void validate(const SeedOptions& options) {
    const auto check = [](const char* field, double value, double low, double high) {
        if (!(value >= low && value <= high)) {
            throw Error(ErrorCode::InvalidInput, std::string("seed.") + field + " must be in [" +
                                                     number_text(low) + ", " + number_text(high) +
                                                     "], got " + number_text(value));
        }
    };
    check("dart_radius", options.dart_radius, 0.5, 1.0);
    check("preload", options.preload, 0.7, 1.2);
    check("wall_distance", options.wall_distance, 0.2, 1.0);
    if (options.max_particles < 1) {
        throw Error(ErrorCode::InvalidInput, "seed.max_particles must be at least 1, got " +
                                                 std::to_string(options.max_particles));
    }
}

Particles seed_surface(const Domain& domain, const FeatureSet& features, const SizingField& sizing,
                       const SeedOptions& options, RunContext& run) {
    validate(options);
    const DartBoard board(domain.boundary(), sizing, run);
    check_count(board.wanted(), options);

    Particles particles;
    DartGrid grid(domain.bounds().low, sizing.h_min(), sizing.h_max(), options.dart_radius);
    seed_corners(domain, features, sizing, particles, grid);
    seed_curves(domain, features, sizing, particles, grid);
    const std::size_t first = particles.size();

    DartThrower thrower(sizing, options, particles, grid);
    for (int round = 0; round < kRounds; ++round) {
        thrower.throw_round(board, round, run);
        run.report(0.3 * (round + 1) / kRounds);
    }
    for_each_index(particles.size() - first, run, [&](std::size_t k) {
        const std::size_t i = first + k;
        const BoundaryPoint on = domain.closest(particles.position[i], particles.anchor[i]);
        particles.position[i] = on.point;
        particles.normal[i] = on.normal;
        particles.anchor[i] = on.facet;
    });
    return in_spatial_order(particles, first, domain.bounds());
}

}  // namespace remesh
