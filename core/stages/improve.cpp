#include "core/stages/improve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <sstream>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/mesh/index.h"
#include "core/mesh/preview.h"
#include "core/parallel.h"
#include "core/stages/improve/boundary_guard.h"
#include "core/stages/improve/flips.h"
#include "core/stages/improve/measures.h"
#include "core/stages/improve/part.h"
#include "core/stages/improve/smooth.h"
#include "core/stages/improve/worst_first.h"
#include "core/stages/text.h"
#include "core/stages/verify.h"

namespace remesh {
namespace {

using improve::index;

constexpr int kMaxRounds = 6;
constexpr double kWorstFirstGoal = 0.5;  // Sine of 30 degrees.
constexpr double kThoroughGoal = 0.46;   // Of 27.4 degrees; triangles of 38.6.
constexpr int kWorstFirstPasses = 6;
constexpr int kPolishPasses = 2;

// Share of work that a mode spends on the worst elements.
struct Plan {
    double power = 3.0;
    double goal = kWorstFirstGoal;
    double thorough_goal = kThoroughGoal;
    int worst_first_passes = kWorstFirstPasses;
};

Plan plan_for(const ImproveOptions& options) {
    if (options.mode == ImproveMode::MaxMinAngle) {
        return {std::max(options.power, 6.0), 0.59, 0.54, 3 * kWorstFirstPasses};
    }
    return {options.power, kWorstFirstGoal, kThoroughGoal, kWorstFirstPasses};
}

// For the surface alone a dihedral of a third of a degree is good enough.
double tet_scale(Aim aim) {
    return aim == Aim::Surface ? 100.0 : 1.0;
}

// Counts of the radius ratio, fine enough for quantiles.
class QualityCounts {
public:
    /// Counts it as `weight` tets.
    void add(double q, std::int64_t weight) {
        const double bin = std::clamp(q, 0.0, 1.0) * kBins;
        bins_[std::min(static_cast<std::size_t>(bin), kBins - 1)] += weight;
        sum_ += q * static_cast<double>(weight);
        count_ += weight;
    }

    void add(const QualityCounts& other) {
        std::transform(bins_.begin(), bins_.end(), other.bins_.begin(), bins_.begin(),
                       std::plus<>());
        sum_ += other.sum_;
        count_ += other.count_;
    }

    [[nodiscard]] QualitySample sample() const {
        QualitySample result;
        if (count_ == 0) {
            return result;
        }
        result.mean = sum_ / static_cast<double>(count_);
        std::int64_t below = 0;
        bool is_found = false;
        for (std::size_t i = 0; i < kBins; ++i) {
            below += bins_[i];
            result.histogram[i * result.histogram.size() / kBins] += bins_[i];
            if (!is_found && 100 * below >= count_) {
                result.first_percentile = (static_cast<double>(i) + 0.5) / kBins;
                is_found = true;
            }
        }
        return result;
    }

private:
    static constexpr std::size_t kBins = 1000;
    std::array<std::int64_t, kBins> bins_{};
    double sum_ = 0.0;
    std::int64_t count_ = 0;
};

// Of those of n tets that `tet_at` gives; of many, every so manyth speaks for all.
template <typename TetAt, typename PointAt>
QualityCounts count_quality(std::size_t n, TetAt tet_at, PointAt point) {
    constexpr std::size_t kSamples = 50'000;
    const std::size_t stride = n / kSamples + 1;
    return tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, n / stride, 4 * kGrain), QualityCounts{},
        [&](const tbb::blocked_range<std::size_t>& rows, QualityCounts counts) {
            for (std::size_t i = rows.begin(); i != rows.end(); ++i) {
                if (const Tet* tet = tet_at(i * stride)) {
                    const auto& [a, b, c, d] = *tet;
                    counts.add(tet_radius_ratio(point(a), point(b), point(c), point(d)),
                               static_cast<std::int64_t>(stride));
                }
            }
            return counts;
        },
        [](QualityCounts a, const QualityCounts& b) {
            a.add(b);
            return a;
        });
}

// One round: from the carved mesh to an improved part of it.
class Round {
public:
    Round(const improve::Whole& carved, const std::vector<std::uint8_t>& frozen,
          const improve::Shape& shape, const ImproveOptions& options, Aim aim, RunContext& run)
        : carved_(carved),
          shape_(shape),
          options_(options),
          plan_(plan_for(options)),
          run_(run),
          part_(improve::cut_part(
              carved,
              aim == Aim::Surface ? improve::at_boundary(carved, frozen)
                                  : improve::near_boundary(carved, frozen, options.flip_below, run),
              tet_scale(aim))),
          untouched_(count_quality(
              carved.mesh.tets.size(),
              [&](std::size_t t) { return part_.is_inside[t] ? nullptr : &carved.mesh.tets[t]; },
              [&](Index v) -> const Vec3& { return carved.mesh.vertices[at(v)]; })) {}

    void run() {
        const int steps = options_.passes + plan_.worst_first_passes;
        for (int pass = 0; pass < options_.passes; ++pass) {
            const auto flips = improve::flip_pass(part_.mesh, options_.flip_below, pass == 0, run_);
            flips_ += flips;
            const auto smoothed = improve::smooth_vertices(part_.mesh, shape_, plan_.power,
                                                           options_.surface_weight, 0.0, run_);
            tell(smoothed, static_cast<double>(pass + 1) / steps);
            if (flips == 0 && smoothed.moved == 0) {
                break;
            }
        }
        raise_worst_elements(steps);
        for (int pass = 0; pass < kPolishPasses; ++pass) {
            improve::smooth_vertices(part_.mesh, shape_, plan_.power, options_.surface_weight,
                                     plan_.goal, run_);
        }
    }

    [[nodiscard]] const improve::Part& part() const { return part_; }
    [[nodiscard]] std::int64_t flips() const { return flips_; }  ///< Before the worst elements.
    [[nodiscard]] const improve::WorstFirstResult& done() const { return done_; }

private:
    void raise_worst_elements(int steps) {
        improve::WorstFirst worst(part_.mesh, shape_, plan_.goal, plan_.thorough_goal);
        const auto count = [&](const improve::WorstFirstResult& done) {
            done_.add(done);
            return done.changes();
        };
        for (int pass = 0; pass < plan_.worst_first_passes; ++pass) {
            auto changes = count(worst.simple_pass(run_));
            if (pass > 0) {
                changes += count(worst.thorough_pass(run_));
            }
            run_.report(static_cast<double>(options_.passes + pass + 1) / steps);
            if (changes == 0) {
                break;
            }
        }
    }

    void tell(const improve::SmoothResult& smoothed, double fraction) {
        const auto& mesh = part_.mesh;
        QualityCounts counts = count_quality(
            mesh.slot_count(),
            [&](std::size_t t) { return mesh.is_alive(index(t)) ? &mesh.tet(index(t)) : nullptr; },
            [&](Index v) -> const Vec3& { return mesh.point(v); });
        counts.add(untouched_);
        ConvergenceSample sample;
        sample.max_displacement = smoothed.max_move;
        sample.rms_displacement = std::sqrt(
            smoothed.sum_squares / std::max<double>(1.0, static_cast<double>(mesh.vertex_count())));
        sample.particles = static_cast<std::int64_t>(carved_.mesh.vertices.size());
        sample.quality = counts.sample();
        run_.sample(sample);
        run_.report(fraction);
    }

    const improve::Whole& carved_;
    const improve::Shape& shape_;
    const ImproveOptions& options_;
    Plan plan_;
    RunContext& run_;
    improve::Part part_;
    QualityCounts untouched_;
    std::int64_t flips_ = 0;
    improve::WorstFirstResult done_{};
};

// What is marked, and all other vertices of the tets that have a marked one.
std::vector<std::uint8_t> with_ring(const std::vector<std::uint8_t>& marked,
                                    const std::vector<Tet>& tets) {
    auto grown = marked;
    for (const auto& tet : tets) {
        if (std::any_of(tet.begin(), tet.end(), [&](Index v) { return marked[at(v)] != 0; })) {
            for (const Index v : tet) {
                grown[at(v)] = 1;
            }
        }
    }
    return grown;
}

// A result with unused vertices left out, and what an exact check found in it.
struct Checked {
    ImproveResult result{};
    std::vector<Index> origin{};  // Of each vertex of the result.
    Faults faults{};
};

Checked compact_and_check(const improve::Assembled& all, const RunContext& run) {
    Checked checked;
    std::vector<Index> id(all.mesh.vertices.size(), kNone);
    for (const auto& tet : all.mesh.tets) {
        for (const Index v : tet) {
            id[at(v)] = 0;
        }
    }
    ImproveResult& result = checked.result;
    for (std::size_t v = 0; v < id.size(); ++v) {
        if (id[v] != kNone) {
            id[v] = index(result.kind.size());
            checked.origin.push_back(index(v));
            result.mesh.vertices.push_back(all.mesh.vertices[v]);
            result.kind.push_back(all.kind[v]);
            result.curve.push_back(all.kind[v] == ParticleKind::Curve ? all.anchor[v] : kNone);
        }
    }
    result.mesh.tets.resize(all.mesh.tets.size());
    for_each_index(result.mesh.tets.size(), run, [&](std::size_t t) {
        for (std::size_t k = 0; k < 4; ++k) {
            result.mesh.tets[t][k] = id[at(all.mesh.tets[t][k])];
        }
    });
    checked.faults = check_tets(result.mesh, run, &result.boundary);
    return checked;
}

// What had been frozen is improved at last, one operation at a time, where it crosses nothing.
// Returns what was done, none of it if the result doesn't check out.
improve::WorstFirstResult thaw(const improve::Assembled& all, ImproveResult& result,
                               std::vector<std::uint8_t> frozen, const improve::Shape& shape,
                               const Plan& plan, Aim aim, RunContext& run) {
    constexpr std::size_t kMostTets = 200'000;  // A thaw looks at all of them again and again.
    frozen.resize(all.mesh.vertices.size(), 0);
    const improve::Whole whole{all.mesh, all.kind, all.anchor};
    auto part = improve::cut_part(whole, improve::around(whole, with_ring(frozen, all.mesh.tets)),
                                  tet_scale(aim));
    improve::WorstFirstResult done;
    if (part.mesh.slot_count() > kMostTets) {
        return done;
    }
    const improve::BoundaryGuard guard(whole, part);
    improve::WorstFirst worst(part.mesh, shape, plan.goal, plan.thorough_goal, &guard);
    for (int pass = 0; pass < plan.worst_first_passes; ++pass) {
        const auto more = worst.thorough_pass(run);
        done.add(more);
        if (more.changes() == 0) {
            break;
        }
    }
    Checked thawed = compact_and_check(improve::put_back(whole, part), run);
    if (thawed.faults.any()) {
        return {};
    }
    result = std::move(thawed.result);
    return done;
}

// Freezes faulty vertices and `rings` rings of tets around them. Inserted vertices can't be frozen,
// as the next round starts without them, but their neighbours can.
void freeze(std::vector<std::uint8_t>& frozen, const Checked& checked, const TetMesh& broken,
            const TetMesh& carved, int rings) {
    std::vector<std::uint8_t> hit(broken.vertices.size(), 0);
    for (const Index v : checked.faults.fault_vertices) {
        hit[at(checked.origin[at(v)])] = 1;
    }
    for (int ring = 0; ring < rings; ++ring) {
        hit = with_ring(with_ring(hit, broken.tets), carved.tets);
    }
    for (std::size_t v = 0; v < frozen.size(); ++v) {
        frozen[v] = frozen[v] || hit[v];
    }
}

ImproveResult unimproved(const CarveResult& carved, const std::vector<Index>& anchor,
                         RunContext& run, const std::function<void(Stage)>& enter) {
    enter(Stage::Verify);
    Checked checked = compact_and_check({carved.mesh, carved.kind, anchor}, run);
    ImproveResult& result = checked.result;
    if (checked.faults.any()) {
        const Vec3& at_fault = result.mesh.vertices[at(checked.faults.fault_vertices.front())];
        const std::string message =
            "no valid mesh was found at this edge length: " + checked.faults.summary() +
            ", first near " + text_of(at_fault);
        run.warn({.code = "INVALID_RESULT", .message = message, .at = at_fault});
        run.preview(decimate(boundary_surface(result.mesh, result.boundary)));
        throw Error(ErrorCode::Unmeshable, message);
    }
    result.mesh.region = carved.mesh.region;
    return std::move(result);
}

void require(bool condition, const char* field, const char* range, double value) {
    if (!condition) {
        std::ostringstream text;
        text << "improve." << field << " must be " << range << ", got " << value;
        throw Error(ErrorCode::InvalidInput, text.str());
    }
}

}  // namespace

void validate(const ImproveOptions& options) {
    require(options.passes >= 0, "passes", "at least 0", options.passes);
    require(options.power >= 1.0 && options.power <= 12.0, "power", "in [1, 12]", options.power);
    require(options.surface_weight >= 0.0 && std::isfinite(options.surface_weight),
            "surface_weight", "finite and at least 0", options.surface_weight);
    require(options.flip_below >= 0.0 && options.flip_below <= 1.0, "flip_below", "in [0, 1]",
            options.flip_below);
}

ImproveResult improve_mesh(const CarveResult& carved, const std::vector<Index>& anchor,
                           const Domain& domain, const FeatureSet& features,
                           const ImproveOptions& options, RunContext& run, Aim aim,
                           const std::function<void(Stage)>& enter) {
    validate(options);
    if (carved.kind.size() != carved.mesh.vertices.size() ||
        anchor.size() < carved.mesh.vertices.size()) {
        throw Error(ErrorCode::InvalidInput,
                    "improve: kind and anchor must have one entry a vertex");
    }
    run.report(0.0);
    if (options.mode == ImproveMode::StrictDelaunay || options.passes == 0) {
        return unimproved(carved, anchor, run, enter);
    }

    const improve::Shape shape{domain, features};
    const improve::Whole whole{carved.mesh, carved.kind, anchor};
    std::vector<std::uint8_t> frozen(carved.mesh.vertices.size(), 0);
    for (int attempt = 1; attempt <= kMaxRounds; ++attempt) {
        if (attempt == kMaxRounds) {
            for (std::size_t v = 0; v < frozen.size(); ++v) {
                frozen[v] = frozen[v] || carved.kind[v] != ParticleKind::Volume;
            }
        }
        Round round(whole, frozen, shape, options, aim, run);
        round.run();
        const auto all = improve::put_back(whole, round.part());
        enter(Stage::Verify);
        Checked checked = compact_and_check(all, run);
        if (!checked.faults.any()) {
            ImproveResult& result = checked.result;
            auto done = round.done();
            if (attempt > 1) {
                enter(Stage::Improve);
                done.add(thaw(all, result, frozen, shape, plan_for(options), aim, run));
            }
            result.flips = round.flips() + done.flips;
            result.collapses = done.collapses;
            result.splits = done.splits;
            result.rounds = attempt;
            result.frozen_vertices = std::count(frozen.begin(), frozen.end(), std::uint8_t{1});
            return std::move(result);
        }
        enter(Stage::Improve);
        freeze(frozen, checked, all.mesh, carved.mesh, attempt);
    }
    auto result = unimproved(carved, anchor, run, enter);
    result.rounds = kMaxRounds + 1;
    result.frozen_vertices = static_cast<std::int64_t>(frozen.size());
    return result;
}

}  // namespace remesh
