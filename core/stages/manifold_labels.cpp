#include "core/stages/manifold_labels.h"

#include <algorithm>
#include <deque>
#include <iterator>
#include <numeric>
#include <tuple>
#include <utility>

#include "core/parallel.h"

namespace remesh {
namespace {

constexpr std::size_t kLargestGroup = 40;     // Tets switched at once.
constexpr std::size_t kLargestPairStar = 40;  // Stars beyond this have too many pairs to try.
constexpr double kLeastHarm = 0.002;          // So that free switches still differ by their gain.

Index root_of(std::vector<Index>& parent, Index i) {
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

// Fans too many plus two for each vertex of the link that doesn't end exactly two of its edges.
int badness_of(VertexLink& link) {
    if (link.edges.empty()) {
        return 0;
    }
    link.ends.clear();
    for (std::size_t i = 0; i < link.edges.size(); ++i) {
        link.ends.push_back({link.edges[i][0], static_cast<Index>(i)});
        link.ends.push_back({link.edges[i][1], static_cast<Index>(i)});
    }
    std::sort(link.ends.begin(), link.ends.end());
    link.parent.resize(link.edges.size());
    std::iota(link.parent.begin(), link.parent.end(), 0);

    int badness = 0;
    auto fans = static_cast<int>(link.edges.size());
    for (std::size_t i = 0; i < link.ends.size();) {
        std::size_t j = i + 1;
        for (; j < link.ends.size() && link.ends[j][0] == link.ends[i][0]; ++j) {
            const Index a = root_of(link.parent, link.ends[i][1]);
            const Index b = root_of(link.parent, link.ends[j][1]);
            if (a != b) {
                link.parent[b] = a;
                --fans;
            }
        }
        badness += j - i == 2 ? 0 : 2;
        i = j;
    }
    return badness + fans - 1;
}

}  // namespace

// Vertices that may be bad, first come first served, each at most once.
class ManifoldLabels::WorkList {
public:
    explicit WorkList(const std::vector<std::int32_t>& badness)
        : badness_(badness), is_queued_(badness.size(), 0) {
        for (std::size_t v = 0; v < badness.size(); ++v) {
            push(static_cast<Index>(v));
        }
    }

    void push(Index v) {
        if (badness_[v] > 0 && is_queued_[v] == 0) {
            is_queued_[v] = 1;
            queue_.push_back(v);
        }
    }

    // The next bad vertex, or kNone.
    Index pop() {
        while (!queue_.empty()) {
            const Index v = queue_.front();
            queue_.pop_front();
            is_queued_[v] = 0;
            if (badness_[v] > 0) {
                return v;
            }
        }
        return kNone;
    }

    [[nodiscard]] std::size_t size() const { return queue_.size(); }

private:
    const std::vector<std::int32_t>& badness_;
    std::vector<std::uint8_t> is_queued_;
    std::deque<Index> queue_;
};

ManifoldLabels::ManifoldLabels(const TetComplex& complex, std::size_t vertices,
                               std::vector<std::uint8_t> inside, CostOf cost_of,
                               const RunContext& run)
    : complex_(complex),
      run_(run),
      cost_of_(std::move(cost_of)),
      inside_(std::move(inside)),
      badness_(vertices, 0),
      cost_(complex.tets.size(), SwitchCost{.harm = -1.0F}) {
    build_stars(vertices);
    for_each_block(vertices, kGrain, run, [&](std::size_t begin, std::size_t end) {
        VertexLink link;
        for (std::size_t v = begin; v < end; ++v) {
            badness_[v] = badness_at(static_cast<Index>(v), link);
        }
    });
}

void ManifoldLabels::build_stars(std::size_t vertices) {
    star_start_.assign(vertices + 1, 0);
    for (const auto& tet : complex_.tets) {
        for (const Index v : tet) {
            ++star_start_[v + 1];
        }
    }
    std::partial_sum(star_start_.begin(), star_start_.end(), star_start_.begin());
    stars_.resize(4 * complex_.tets.size());
    auto next = star_start_;
    for (std::size_t t = 0; t < complex_.tets.size(); ++t) {
        for (const Index v : complex_.tets[t]) {
            stars_[next[v]++] = static_cast<Index>(t);
        }
    }
}

std::span<const Index> ManifoldLabels::star(Index v) const {
    return {stars_.data() + star_start_[v], stars_.data() + star_start_[v + 1]};
}

// Whether the face opposite of a corner of an inside tet separates inside from outside.
bool ManifoldLabels::is_boundary(Index tet, std::size_t corner) const {
    const Index other = complex_.neighbours[tet][corner];
    return other == kNone || inside_[other] == 0;
}

int ManifoldLabels::badness_at(Index v, VertexLink& link) const {
    link.edges.clear();
    for (const Index t : star(v)) {
        if (inside_[t] == 0) {
            continue;
        }
        const Tet& tet = complex_.tets[t];
        for (std::size_t corner = 0; corner < 4; ++corner) {
            if (tet[corner] == v || !is_boundary(t, corner)) {
                continue;
            }
            std::array<Index, 2> edge{};
            std::size_t n = 0;
            for (std::size_t other = 0; other < 4; ++other) {
                if (other != corner && tet[other] != v) {
                    edge[n++] = tet[other];
                }
            }
            link.edges.push_back(edge);
        }
    }
    return badness_of(link);
}

const SwitchCost& ManifoldLabels::cost(Index tet) {
    if (cost_[tet].harm < 0.0F) {
        cost_[tet] = cost_of_(tet);
    }
    return cost_[tet];
}

double ManifoldLabels::total_harm(const Group& group) {
    return std::accumulate(group.begin(), group.end(), 0.0,
                           [&](double sum, Index t) { return sum + cost(t).harm; });
}

std::int64_t ManifoldLabels::bad_vertices() const {
    return std::count_if(badness_.begin(), badness_.end(),
                         [](auto badness) { return badness > 0; });
}

// Tets around v with one label, grouped where they share faces at v.
std::vector<ManifoldLabels::Group> ManifoldLabels::fans(Index v, std::uint8_t label) const {
    Group tets;
    std::copy_if(star(v).begin(), star(v).end(), std::back_inserter(tets),
                 [&](Index t) { return inside_[t] == label; });
    std::vector<Index> parent(tets.size());
    std::iota(parent.begin(), parent.end(), 0);
    for (std::size_t i = 0; i < tets.size(); ++i) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            if (complex_.tets[tets[i]][corner] == v) {
                continue;
            }
            const Index other = complex_.neighbours[tets[i]][corner];
            const auto found = std::lower_bound(tets.begin(), tets.end(), other);
            if (found != tets.end() && *found == other) {
                const Index a = root_of(parent, static_cast<Index>(i));
                const Index b = root_of(parent, static_cast<Index>(found - tets.begin()));
                parent[std::max(a, b)] = std::min(a, b);
            }
        }
    }
    std::vector<Group> groups;
    std::vector<std::size_t> group_of(tets.size());
    for (std::size_t i = 0; i < tets.size(); ++i) {
        const Index root = root_of(parent, static_cast<Index>(i));
        if (root == static_cast<Index>(i)) {
            group_of[i] = groups.size();
            groups.emplace_back();
        }
        groups[group_of[root]].push_back(tets[i]);
    }
    return groups;
}

void ManifoldLabels::add_fans(Index v) {
    for (const std::uint8_t label : {std::uint8_t{1}, std::uint8_t{0}}) {
        auto groups = fans(v, label);
        if (groups.size() > 1) {
            for (auto& group : groups) {
                consider(std::move(group));
            }
        }
    }
}

// All tets of one label around an edge between v and another bad vertex.
void ManifoldLabels::add_edge_fans(Index v) {
    struct Spoke {
        Index other;
        std::uint8_t inside;
        Index tet;
    };
    std::vector<Spoke> spokes;
    for (const Index t : star(v)) {
        for (const Index w : complex_.tets[t]) {
            if (w != v && badness_[w] > 0) {
                spokes.push_back({w, inside_[t], t});
            }
        }
    }
    std::sort(spokes.begin(), spokes.end(), [](const Spoke& a, const Spoke& b) {
        return std::tie(a.other, a.inside, a.tet) < std::tie(b.other, b.inside, b.tet);
    });
    for (std::size_t i = 0; i < spokes.size();) {
        Group group;
        std::size_t j = i;
        for (; j < spokes.size() && spokes[j].other == spokes[i].other &&
               spokes[j].inside == spokes[i].inside;
             ++j) {
            group.push_back(spokes[j].tet);
        }
        consider(std::move(group));
        i = j;
    }
}

// Two tets of one label that share an edge at v and maybe a face.
void ManifoldLabels::add_pairs(Index v) {
    const auto tets = star(v);
    if (tets.size() >= kLargestPairStar) {
        return;
    }
    for (std::size_t i = 0; i < tets.size(); ++i) {
        for (std::size_t j = i + 1; j < tets.size(); ++j) {
            const Tet& a = complex_.tets[tets[i]];
            const Tet& b = complex_.tets[tets[j]];
            const auto shared = std::count_if(a.begin(), a.end(), [&](Index w) {
                return std::find(b.begin(), b.end(), w) != b.end();
            });
            if (shared >= 2 && inside_[tets[i]] == inside_[tets[j]]) {
                consider({tets[i], tets[j]});
            }
        }
    }
}

// Keeps the group if switching it loses the most badness for its harm so far.
void ManifoldLabels::consider(Group group) {
    if (group.size() > kLargestGroup || std::any_of(group.begin(), group.end(), [&](Index t) {
            return inside_[t] == 0 && !cost(t).may_enter;
        })) {
        return;
    }
    list_vertices(group);
    const int before = std::accumulate(touched_.begin(), touched_.end(), 0,
                                       [&](int sum, Index w) { return sum + badness_[w]; });
    const double harm = total_harm(group) + kLeastHarm;
    const auto score = [&](int after) { return (before - after) / harm; };
    if (score(0) <= best_score_) {
        return;
    }
    flip(group);
    int after = 0;
    for (auto w = touched_.begin(); w != touched_.end() && score(after) > best_score_; ++w) {
        after += badness_at(*w, link_);
    }
    flip(group);
    if (score(after) > best_score_) {
        best_score_ = score(after);
        best_ = std::move(group);
    }
}

void ManifoldLabels::list_vertices(const Group& group) {
    touched_.clear();
    for (const Index t : group) {
        touched_.insert(touched_.end(), complex_.tets[t].begin(), complex_.tets[t].end());
    }
    std::sort(touched_.begin(), touched_.end());
    touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
}

void ManifoldLabels::flip(const Group& group) {
    for (const Index t : group) {
        inside_[t] ^= 1;
    }
}

void ManifoldLabels::apply(const Group& group, WorkList& work) {
    flip(group);
    switches_ += static_cast<std::int64_t>(group.size());
    list_vertices(group);
    for (const Index w : touched_) {
        badness_[w] = badness_at(w, link_);
        work.push(w);
    }
}

void ManifoldLabels::switch_greedily() {
    WorkList work(badness_);
    // Every step lowers the total badness; the bound is on vertices looked at in vain.
    auto budget = 20 * (static_cast<std::int64_t>(work.size()) + 50);
    for (Index v = work.pop(); v != kNone && budget-- > 0; v = work.pop()) {
        run_.checkpoint();
        best_.clear();
        best_score_ = 0.0;
        for (const Index t : star(v)) {
            if (inside_[t] == 0 || !cost(t).keep) {
                consider({t});
            }
        }
        add_fans(v);
        add_edge_fans(v);
        if (best_.empty()) {
            add_pairs(v);
        }
        if (!best_.empty()) {
            const Group chosen = std::move(best_);
            apply(chosen, work);
        }
    }
}

ManifoldLabels::Group ManifoldLabels::forced_removal(Index v) {
    auto groups = fans(v, 1);
    Group removal;
    if (groups.size() > 1) {
        std::size_t largest = 0;
        for (std::size_t i = 1; i < groups.size(); ++i) {
            if (total_harm(groups[i]) > total_harm(groups[largest])) {
                largest = i;
            }
        }
        for (std::size_t i = 0; i < groups.size(); ++i) {
            if (i != largest) {
                removal.insert(removal.end(), groups[i].begin(), groups[i].end());
            }
        }
        return removal;
    }
    std::copy_if(groups[0].begin(), groups[0].end(), std::back_inserter(removal),
                 [&](Index t) { return !cost(t).keep; });
    return removal.empty() ? groups[0] : removal;
}

void ManifoldLabels::remove_until_manifold() {
    WorkList work(badness_);
    for (Index v = work.pop(); v != kNone; v = work.pop()) {
        run_.checkpoint();
        apply(forced_removal(v), work);
        ++forced_steps_;
    }
}

}  // namespace remesh
