#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/exact/delaunay.h"
#include "core/run_context.h"

namespace remesh {

/// What it would do to the body to switch a tet in or out.
struct SwitchCost {
    float harm = 0.0F;       ///< About the volume changed over h^3, >= 0.
    bool keep = false;       ///< Surely inside: taken out only along with others.
    bool may_enter = false;  ///< False for tets too flat to be worth having.
};

/// Boundary triangles around one vertex, as the edges opposite of it; scratch to judge them.
struct VertexLink {
    std::vector<std::array<Index, 2>> edges{};
    std::vector<std::array<Index, 2>> ends{};  // Vertex and edge, sorted.
    std::vector<Index> parent{};               // Fan of each edge, as a union-find forest.
};

/// Inside and outside labels of the tets of a Delaunay triangulation, and how the boundary between
/// them looks at each vertex. Switches labels until the boundary is edge- and vertex-manifold.
///
/// The badness of a vertex is 0 where its boundary triangles are one fan or none; else one for each
/// fan too many, and two for each edge that has not exactly two triangles.
class ManifoldLabels {
public:
    using CostOf = std::function<SwitchCost(Index)>;

    /// \param complex  outlives this
    /// \param inside   #T labels, 1 inside
    /// \param cost_of  asked once for each tet near a bad vertex
    ManifoldLabels(const TetComplex& complex, std::size_t vertices,
                   std::vector<std::uint8_t> inside, CostOf cost_of, const RunContext& run);

    /// Greedy: at each bad vertex, the switch of one tet, of a fan or of a pair with the largest
    /// loss of badness for its harm, until none gains. May leave bad vertices.
    void switch_greedily();

    /// Only takes tets out, so it ends, and no vertex is bad then: all but the largest fan of a bad
    /// vertex, else the tets that need not be kept, else its whole star.
    void remove_until_manifold();

    [[nodiscard]] std::int64_t bad_vertices() const;
    [[nodiscard]] std::int64_t switches() const { return switches_; }
    [[nodiscard]] std::int64_t forced_steps() const { return forced_steps_; }
    [[nodiscard]] const std::vector<std::uint8_t>& inside() const { return inside_; }

private:
    using Group = std::vector<Index>;  // Tets, switched together.
    class WorkList;

    void build_stars(std::size_t vertices);
    [[nodiscard]] std::span<const Index> star(Index v) const;
    [[nodiscard]] bool is_boundary(Index tet, std::size_t corner) const;
    int badness_at(Index v, VertexLink& link) const;
    const SwitchCost& cost(Index tet);
    double total_harm(const Group& group);

    [[nodiscard]] std::vector<Group> fans(Index v, std::uint8_t label) const;
    void add_fans(Index v);
    void add_edge_fans(Index v);
    void add_pairs(Index v);
    void consider(Group group);
    Group forced_removal(Index v);

    void list_vertices(const Group& group);
    void flip(const Group& group);
    void apply(const Group& group, WorkList& work);

    const TetComplex& complex_;
    const RunContext& run_;
    CostOf cost_of_;
    std::vector<std::uint8_t> inside_;
    std::vector<Index> star_start_;  // Tets around v: stars_[star_start_[v]], ascending.
    std::vector<Index> stars_;
    std::vector<std::int32_t> badness_;  // Of every vertex, up to date.
    std::vector<SwitchCost> cost_;       // Negative harm: not asked yet.
    std::int64_t switches_ = 0;
    std::int64_t forced_steps_ = 0;

    Group best_;  // Of the candidates considered for one vertex.
    double best_score_ = 0.0;
    std::vector<Index> touched_;  // Scratch: vertices of a group.
    VertexLink link_;
};

}  // namespace remesh
