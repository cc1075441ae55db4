#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/particles.h"
#include "core/mesh/index.h"
#include "core/mesh/mesh.h"
#include "core/mesh/tet_corners.h"
#include "core/stages/carve.h"

namespace remesh::improve {

inline Index index(std::size_t i) {
    return static_cast<Index>(i);
}
inline bool has(const Tet& tet, Index v) {
    return tet[0] == v || tet[1] == v || tet[2] == v || tet[3] == v;
}

/// An edge of a vertex's link; with the vertex in front it is a boundary triangle facing outward.
struct LinkEdge {
    Index from = kNone;
    Index to = kNone;
};

/// The part of a tet mesh that changes: tets that can be added and removed, and the tets around
/// every vertex. Changes can be undone back to a mark. Not safe for more than one thread but for
/// `move` on vertices that share no tet.
class LiveMesh {
public:
    /// Who wants to know what has changed.
    enum class Use : std::uint8_t { Smoothing = 1, Search = 2, Flips = 4 };

    [[nodiscard]] std::size_t vertex_count() const { return points_.size(); }
    [[nodiscard]] std::size_t slot_count() const { return tets_.size(); }
    [[nodiscard]] bool is_alive(Index t) const { return tets_[at(t)][0] != kNone; }
    [[nodiscard]] const Tet& tet(Index t) const { return tets_[at(t)]; }
    [[nodiscard]] const Vec3& point(Index v) const { return points_[at(v)]; }
    [[nodiscard]] ParticleKind kind(Index v) const { return kinds_[at(v)]; }
    [[nodiscard]] Index anchor(Index v) const { return anchors_[at(v)]; }
    [[nodiscard]] bool on_boundary(Index v) const { return kinds_[at(v)] != ParticleKind::Volume; }
    /// May neither move nor go: it has tets outside of this part, or was frozen.
    [[nodiscard]] bool is_locked(Index v) const { return locked_[at(v)]; }
    /// In scores and stars dihedral sines count this many times as much as they are, beside the
    /// angles of boundary triangles: above 1 where tets are but a means, and need only be far from
    /// flat. Flips and collapses take them as they are.
    [[nodiscard]] double tet_scale() const { return tet_scale_; }
    void set_tet_scale(double scale) { tet_scale_ = scale; }
    /// Alive tets at a vertex. Adding and removing tets invalidates it.
    [[nodiscard]] std::span<const Index> around(Index v) const {
        const auto& block = blocks_[at(v)];
        return {pool_.data() + block.offset, block.count};
    }
    /// Whether a vertex moved or lost or won tets since its flag for some use was cleared.
    [[nodiscard]] bool has_changed(Index v, Use use = Use::Smoothing) const {
        return (changed_[at(v)] & static_cast<std::uint8_t>(use)) != 0;
    }
    void set_changed(Index v, bool changed, Use use = Use::Smoothing) {
        const auto bit = static_cast<std::uint8_t>(use);
        auto& flags = changed_[at(v)];
        flags = static_cast<std::uint8_t>(changed ? flags | bit : flags & ~bit);
    }

    Index add_vertex(const Vec3& point, ParticleKind kind, Index anchor, bool locked);
    Index add(const Tet& tet);
    void remove(Index t);
    /// Puts back the tet that was removed last, where it was.
    void restore(Index t, const Tet& tet);
    void move(Index v, const Vec3& point, Index anchor) {
        points_[at(v)] = point;
        anchors_[at(v)] = anchor;
    }

    /// From here on changes are recorded, until `commit` or `roll_back`, which also takes back
    /// vertices and slots.
    void begin();
    void commit();
    void roll_back();
    /// As `move`, but can be rolled back, and sets the changed flags.
    void move_recorded(Index v, const Vec3& point, Index anchor);
    /// Frees a surface vertex that has come to lie inside.
    void bury(Index v);
    /// Tets added since `begin`, and those around vertices moved since, that are still alive.
    /// `tets` is replaced; sorted, without repeats.
    void touched(std::vector<Index>& tets) const;

    /// Whether the face opposite of a corner has no tet behind it.
    [[nodiscard]] bool is_boundary_face(Index t, std::size_t corner) const;
    /// Boundary triangles at a vertex, as edges of its link. `edges` is replaced.
    void boundary_fan(Index v, std::vector<LinkEdge>& edges) const;
    /// Whether the boundary triangles at a vertex are one closed fan (or there are none).
    [[nodiscard]] bool is_one_fan(Index v) const;

    void reserve(std::size_t vertices, std::size_t tets);
    /// Builds the lists of tets around vertices, after the first tets were appended.
    void append_tet(const Tet& tet) { tets_.push_back(tet); }
    void build_incidence();

private:
    struct Block {
        std::uint32_t offset = 0;
        std::uint16_t count = 0;
        std::uint16_t capacity = 0;
    };
    static constexpr std::uint8_t kChanged = 0xFF;  // For every use.
    enum class Change : std::uint8_t { Added, Removed, Moved };
    struct Record {
        Change change = Change::Added;
        Index id = kNone;
        Tet tet{};
        Vec3 point = Vec3::Zero();
        Index anchor = kNone;
        ParticleKind kind = ParticleKind::Volume;
    };

    void record_place(Index v);
    void attach(Index v, Index t);
    void detach(Index v, Index t);
    void fill_slot(Index t, const Tet& tet);

    Points points_;
    std::vector<ParticleKind> kinds_;
    std::vector<Index> anchors_;
    std::vector<std::uint8_t> locked_;
    std::vector<std::uint8_t> changed_;
    std::vector<Tet> tets_;  // A removed one has kNone in front; slots aren't used again.
    std::vector<Block> blocks_;
    std::vector<Index> pool_;
    std::vector<Record> journal_;
    double tet_scale_ = 1.0;
    bool recording_ = false;
    std::size_t first_vertex_ = 0;  // Added since `begin`.
    std::size_t first_slot_ = 0;
};

}  // namespace remesh::improve
