#include "core/stages/orient.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "core/geometry/bvh.h"
#include "core/geometry/edge_table.h"
#include "core/geometry/winding_number.h"
#include "core/parallel.h"
#include "core/stages/orient_sheets.h"
#include "core/stages/surface_math.h"

namespace remesh {
namespace {

constexpr std::size_t kFewTriangles = 12;  // Pieces below are soup: oriented one by one.
constexpr std::size_t kMaxParts = 200;     // So many large parts are compared with one another.
constexpr std::size_t kSamples = 60;       // Triangles of a part that are looked at.
constexpr int kSoupPasses = 4;
constexpr double kMostOffset = 0.5;     // Of h: how far from a triangle its sides are looked at.
constexpr double kNotableSheet = 1e-3;  // Of all area: smaller sheets decide nothing.
constexpr double kNotable = 1e-4;  // Of the largest part's area: below, a part contains nothing.

struct Part {
    std::vector<Index> triangles{};
    double area = 0.0;
    double volume = 0.0;  // Signed, as oriented now.
    Box box{};
    bool is_closed = true;
    bool is_dropped = false;
    bool was_turned = false;
};

/// A part as something to ask for the inside.
struct Body {
    std::size_t part = 0;
    std::unique_ptr<Bvh> bvh{};                // Made when first asked.
    std::unique_ptr<WindingNumber> winding{};  // Likewise.
};

/// How a part lies with regard to another one.
struct Relation {
    bool is_inside = false;
    bool is_second_wall = false;
};

class Orienter {
public:
    Orienter(const SurfaceMesh& surface, double h, const PrepareOptions& options, RunContext& run)
        : surface_(surface), h_(h), options_(options), run_(run) {}

    OrientResult orient() {
        find_parts();
        for (auto& part : parts_) {
            measure(part);
        }
        run_.checkpoint();
        nest_parts();
        turn_sheets();
        drop_specks();
        drop_parts();
        turn_soup();
        report_turned();
        return {std::move(surface_), std::move(defects_)};
    }

private:
    void turn(std::size_t i) { std::swap(surface_.triangles[i][0], surface_.triangles[i][1]); }

    void turn(Part& part) {
        for (const Index i : part.triangles) {
            turn(static_cast<std::size_t>(i));
        }
        part.volume = -part.volume;
        part.was_turned = true;
    }

    void find_parts() {
        const std::size_t n = surface_.triangles.size();
        const EdgeTable table(surface_.triangles, surface_.vertices.size());
        std::vector<char> seen(n, 0);
        std::vector<char> against(n, 0);  // Runs against the part's first triangle.
        for (std::size_t s = 0; s < n; ++s) {
            if (seen[s]) {
                continue;
            }
            Part part;
            part.triangles.push_back(static_cast<Index>(s));
            seen[s] = 1;
            for (std::size_t q = 0; q < part.triangles.size(); ++q) {
                const Index i = part.triangles[q];
                for (EdgeTable::HalfEdge h = 3 * i; h != 3 * i + 3; ++h) {
                    const auto& edge = table.edge_of(h);
                    part.is_closed = part.is_closed && edge.count == 2;
                    if (edge.count != 2) {
                        continue;
                    }
                    const auto halves = table.half_edges(edge);
                    const auto other = halves[0] == h ? halves[1] : halves[0];
                    const std::size_t k = EdgeTable::triangle_of(other);
                    if (seen[k]) {
                        continue;
                    }
                    seen[k] = 1;
                    const bool same =
                        start_of(surface_.triangles, other) == start_of(surface_.triangles, h);
                    against[k] = same ? !against[static_cast<std::size_t>(i)]
                                      : against[static_cast<std::size_t>(i)];
                    part.triangles.push_back(static_cast<Index>(k));
                }
            }
            follow_majority(part, against);
            parts_.push_back(std::move(part));
        }
    }

    void follow_majority(const Part& part, const std::vector<char>& against) {
        std::array<double, 2> area{};
        for (const Index i : part.triangles) {
            const auto k = static_cast<std::size_t>(i);
            area[static_cast<std::size_t>(against[k])] += area_vector(surface_, k).norm();
        }
        const char minority = area[1] > area[0] ? 0 : 1;
        for (const Index i : part.triangles) {
            const auto k = static_cast<std::size_t>(i);
            if (against[k] == minority) {
                turn(k);
                note_flipped(k);
            }
        }
    }

    void note_flipped(std::size_t i) {
        if (flipped_++ == 0) {
            first_flipped_ = centroid(surface_, i);
        }
    }

    void measure(Part& part) const {
        const Vec3 apex = center_of_area(surface_, part.triangles);
        for (const Index i : part.triangles) {
            const auto k = static_cast<std::size_t>(i);
            part.area += area_vector(surface_, k).norm();
            part.volume += cone_volume(surface_, k, apex);
            for (std::size_t c = 0; c < 3; ++c) {
                part.box.include(corner(surface_, k, c));
            }
        }
    }

    void make_ready(Body& body) const {
        if (body.bvh) {
            return;
        }
        std::vector<Triangle> triangles;
        triangles.reserve(parts_[body.part].triangles.size());
        for (const Index i : parts_[body.part].triangles) {
            triangles.push_back(surface_.triangles[static_cast<std::size_t>(i)]);
        }
        body.bvh = std::make_unique<Bvh>(surface_.vertices, triangles);
        body.winding = std::make_unique<WindingNumber>(surface_.vertices, triangles);
    }

    [[nodiscard]] Relation relate(const Part& part, Body& body) const {
        const Part& other = parts_[body.part];
        const Vec3 margin = Vec3::Constant(h_);
        if ((part.box.low.array() > (other.box.high + margin).array()).any() ||
            (part.box.high.array() < (other.box.low - margin).array()).any()) {
            return {};
        }
        make_ready(body);
        std::size_t samples = 0;
        std::size_t inside = 0;
        std::size_t near = 0;
        const std::size_t step = std::max<std::size_t>(1, part.triangles.size() / kSamples);
        const double reach2 = 0.75 * h_ * 0.75 * h_;
        for (std::size_t q = 0; q < part.triangles.size(); q += step) {
            const Vec3 point = centroid(surface_, static_cast<std::size_t>(part.triangles[q]));
            ++samples;
            inside += std::abs(body.winding->at(point)) > 0.5;
            near += body.bvh->closest(point, reach2).has_value();
        }
        const auto share = [&](std::size_t count) {
            return static_cast<double>(count) / static_cast<double>(samples);
        };
        return {.is_inside = share(inside) > 0.9,
                .is_second_wall =
                    share(near) > 0.95 && std::abs(part.volume) > 0.5 * std::abs(other.volume)};
    }

    /// Largest part first, so that what contains a part has its direction before it.
    void nest_parts() {
        std::vector<std::size_t> order;
        double largest_area = 0.0;
        for (std::size_t i = 0; i < parts_.size(); ++i) {
            const Part& part = parts_[i];
            const bool has_inside = std::abs(part.volume) > 1e-3 * std::pow(part.area, 1.5);
            if (has_inside && (part.triangles.size() >= kFewTriangles || part.is_closed)) {
                order.push_back(i);
                largest_area = std::max(largest_area, part.area);
            }
        }
        std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
            return std::abs(parts_[a].volume) > std::abs(parts_[b].volume);
        });
        for (const std::size_t i : order) {
            run_.checkpoint();
            place(i, parts_[i].area > kNotable * largest_area);
        }
    }

    void place(std::size_t i, bool is_notable) {
        Part& part = parts_[i];
        const Part* container = nullptr;
        for (Body& body : bodies_) {
            const Relation relation = relate(part, body);
            if (relation.is_second_wall) {
                part.is_dropped = true;
                note(double_walls_, first_double_wall_, part);
                return;
            }
            if (relation.is_inside) {
                container = &parts_[body.part];  // The last is the smallest so far.
            }
        }
        if (container == nullptr) {
            if (part.volume < 0.0) {
                turn(part);
                note(inside_out_, first_inside_out_, part);
            }
        } else {
            if (container->was_turned) {
                turn(part);
            }
            if (part.volume < 0.0 && part.is_closed && !options_.keep_cavities) {
                part.is_dropped = true;
                note(cavities_, first_cavity_, part);
                return;
            }
        }
        if (bodies_.size() < kMaxParts && is_notable) {
            bodies_.push_back({.part = i});
        }
    }

    /// Open parts have no side of their own that is inside: they are turned together.
    void turn_sheets() {
        double area = 0.0;
        for (const Part& part : parts_) {
            area += part.is_dropped ? 0.0 : part.area;
        }
        std::vector<Part*> sheets;
        std::vector<const std::vector<Index>*> triangles;
        for (Part& part : parts_) {
            if (!part.is_dropped && !part.is_closed && part.triangles.size() >= kFewTriangles &&
                part.area > kNotableSheet * area && sheets.size() < kMaxParts) {
                sheets.push_back(&part);
                triangles.push_back(&part.triangles);
            }
        }
        if (sheets.size() < 2) {
            return;
        }
        const auto turned = find_turned_sheets(surface_, triangles, run_);
        for (std::size_t i = 0; i < sheets.size(); ++i) {
            if (turned[i]) {
                turn(*sheets[i]);
                note(turned_sheets_, first_turned_sheet_, *sheets[i]);
            }
        }
    }

    /// Whether a part is closed, or nearly: a ball has 0.094, half of one 0.1, a flat piece 0.
    static bool has_volume(const Part& part) {
        return part.is_closed || (part.triangles.size() >= kFewTriangles &&
                                  std::abs(part.volume) > 0.03 * std::pow(part.area, 1.5));
    }

    void drop_specks() {
        double largest = 0.0;
        for (const Part& part : parts_) {
            if (has_volume(part) && !part.is_dropped) {
                largest = std::max(largest, std::abs(part.volume));
            }
        }
        for (Part& part : parts_) {
            if (has_volume(part) && !part.is_dropped &&
                std::abs(part.volume) < options_.speck_volume * largest) {
                part.is_dropped = true;
                note(specks_, first_speck_, part);
            }
        }
    }

    void note(std::int64_t& count, std::optional<Vec3>& first, const Part& part) const {
        if (count++ == 0) {
            first = corner(surface_, static_cast<std::size_t>(part.triangles.front()), 0);
        }
    }

    void drop_parts() {
        std::vector<char> dropped(surface_.triangles.size(), 0);
        is_soup_.assign(surface_.triangles.size(), 0);
        for (const Part& part : parts_) {
            for (const Index i : part.triangles) {
                dropped[static_cast<std::size_t>(i)] = part.is_dropped;
                is_soup_[static_cast<std::size_t>(i)] =
                    part.triangles.size() < kFewTriangles && !part.is_closed;
            }
        }
        std::size_t kept = 0;
        for (std::size_t i = 0; i < dropped.size(); ++i) {
            if (dropped[i]) {
                continue;
            }
            surface_.triangles[kept] = surface_.triangles[i];
            is_soup_[kept] = is_soup_[i];
            if (!surface_.patch.empty()) {
                surface_.patch[kept] = surface_.patch[i];
            }
            ++kept;
        }
        surface_.triangles.resize(kept);
        surface_.patch.resize(surface_.patch.empty() ? 0 : kept);
        is_soup_.resize(kept);
    }

    /// Turns small open pieces by what all the other triangles say about their two sides.
    void turn_soup() {
        if (std::find(is_soup_.begin(), is_soup_.end(), 1) == is_soup_.end()) {
            return;
        }
        const std::size_t n = surface_.triangles.size();
        const EdgeTable table(surface_.triangles, surface_.vertices.size());
        DisjointSets pieces(n);
        for (const auto& edge : table.edges()) {
            if (edge.count == 2) {
                const auto halves = table.half_edges(edge);
                pieces.merge(static_cast<Index>(EdgeTable::triangle_of(halves[0])),
                             static_cast<Index>(EdgeTable::triangle_of(halves[1])));
            }
        }
        std::vector<char> turned(n, 0);
        const auto agree = [&] {
            const auto jump = [](const Sides& sides) { return sides.behind - sides.ahead; };
            for (int pass = 0; pass < kSoupPasses && turn_pieces(pieces, turned, jump); ++pass) {
            }
        };
        agree();
        // A soup that faces inward all over agrees with itself, too: -1 inside, 0 outside.
        if (turn_pieces(pieces, turned, [](const Sides& s) { return s.behind + s.ahead; })) {
            agree();
        }
        for (std::size_t i = 0; i < n; ++i) {
            if (turned[i]) {
                note_flipped(i);
            }
        }
    }

    /// Winding numbers of all other triangles on the two sides of one.
    struct Sides {
        double behind = 0.0;
        double ahead = 0.0;
    };

    [[nodiscard]] Sides sides_of(const WindingNumber& winding, std::size_t i) const {
        const Vec3 area = area_vector(surface_, i);
        // Not beyond the other side of what is thin.
        const double size = std::sqrt(area.norm());
        const Vec3 offset = std::min(1.0, kMostOffset * h_ / size) / size * area;
        const Vec3 middle = centroid(surface_, i);
        const auto others = [&](const Vec3& p) {
            return winding.at(p) - solid_angle(p, corner(surface_, i, 0), corner(surface_, i, 1),
                                               corner(surface_, i, 2)) /
                                       (4.0 * std::numbers::pi);
        };
        return {.behind = others(middle - offset), .ahead = others(middle + offset)};
    }

    /// Turns the pieces of soup whose triangles vote below zero in sum, weighted by area.
    /// \return whether there was any
    template <typename Vote>
    bool turn_pieces(DisjointSets& pieces, std::vector<char>& turned, const Vote& vote) {
        const std::size_t n = surface_.triangles.size();
        const WindingNumber winding(surface_.vertices, surface_.triangles);
        std::vector<double> votes(n, 0.0);
        for_each_index(n, run_, [&](std::size_t i) {
            if (is_soup_[i]) {
                votes[i] = area_vector(surface_, i).norm() * vote(sides_of(winding, i));
            }
        });
        const auto piece_of = [&](std::size_t i) {
            return static_cast<std::size_t>(pieces.find(static_cast<Index>(i)));
        };
        std::vector<double> sum(n, 0.0);
        for (std::size_t i = 0; i < n; ++i) {
            sum[piece_of(i)] += votes[i];
        }
        bool any = false;
        for (std::size_t i = 0; i < n; ++i) {
            if (is_soup_[i] && sum[piece_of(i)] < 0.0) {
                turn(i);
                turned[i] = !turned[i];
                any = true;
            }
        }
        return any;
    }

    void report_turned() {
        const auto add = [&](const char* code, std::int64_t count, std::optional<Vec3> at,
                             const std::string& text) {
            if (count > 0) {
                defects_.push_back({.code = code, .description = text, .count = count, .at = at});
            }
        };
        add("INSIDE_OUT", inside_out_, first_inside_out_,
            count_of(inside_out_, "part") + " faced inward and turned around");
        add("TURNED_SHEETS", turned_sheets_, first_turned_sheet_,
            count_of(turned_sheets_, "open part") + " turned to enclose a body with the others");
        add("FLIPPED_TRIANGLES", flipped_, first_flipped_,
            count_of(flipped_, "triangle") + " faced against the neighbours and turned around");
        add("DOUBLE_WALL", double_walls_, first_double_wall_,
            count_of(double_walls_, "second wall") + " close to another one left out");
        add("CAVITIES", cavities_, first_cavity_,
            count_of(cavities_, "inward shell") + " inside a body filled");
        add("SPECKS", specks_, first_speck_, count_of(specks_, "small part") + " left out");
    }

    SurfaceMesh surface_;
    double h_;
    const PrepareOptions& options_;
    RunContext& run_;
    std::vector<Part> parts_;
    std::vector<Body> bodies_;
    std::vector<char> is_soup_;
    std::vector<Defect> defects_;
    std::int64_t inside_out_ = 0;
    std::int64_t turned_sheets_ = 0;
    std::int64_t flipped_ = 0;
    std::int64_t double_walls_ = 0;
    std::int64_t cavities_ = 0;
    std::int64_t specks_ = 0;
    std::optional<Vec3> first_inside_out_;
    std::optional<Vec3> first_turned_sheet_;
    std::optional<Vec3> first_flipped_;
    std::optional<Vec3> first_double_wall_;
    std::optional<Vec3> first_cavity_;
    std::optional<Vec3> first_speck_;
};

}  // namespace

OrientResult orient_surface(const SurfaceMesh& surface, double h, const PrepareOptions& options,
                            RunContext& run) {
    return Orienter(surface, h, options, run).orient();
}

}  // namespace remesh
