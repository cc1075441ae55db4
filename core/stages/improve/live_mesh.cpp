#include "core/stages/improve/live_mesh.h"

#include <algorithm>

namespace remesh::improve {

Index LiveMesh::add_vertex(const Vec3& point, ParticleKind kind, Index anchor, bool locked) {
    points_.push_back(point);
    kinds_.push_back(kind);
    anchors_.push_back(anchor);
    locked_.push_back(locked);
    changed_.push_back(kChanged);
    blocks_.emplace_back();
    return index(points_.size() - 1);
}

void LiveMesh::reserve(std::size_t vertices, std::size_t tets) {
    points_.reserve(vertices);
    kinds_.reserve(vertices);
    anchors_.reserve(vertices);
    locked_.reserve(vertices);
    changed_.reserve(vertices);
    blocks_.reserve(vertices);
    tets_.reserve(tets + tets / 16);
}

void LiveMesh::build_incidence() {
    constexpr std::uint32_t kSlack = 4;
    for (const auto& tet : tets_) {
        for (const Index v : tet) {
            ++blocks_[at(v)].capacity;
        }
    }
    std::uint32_t offset = 0;
    for (auto& block : blocks_) {
        block.offset = offset;
        block.capacity = static_cast<std::uint16_t>(block.capacity + kSlack);
        offset += block.capacity;
    }
    pool_.reserve(offset + offset / 8);
    pool_.resize(offset);
    for (std::size_t t = 0; t < tets_.size(); ++t) {
        for (const Index v : tets_[t]) {
            auto& block = blocks_[at(v)];
            pool_[block.offset + block.count++] = index(t);
        }
    }
}

void LiveMesh::attach(Index v, Index t) {
    auto& block = blocks_[at(v)];
    if (block.count == block.capacity) {
        const auto moved = static_cast<std::uint32_t>(pool_.size());
        const auto capacity = static_cast<std::uint16_t>(2 * block.capacity + 8);
        pool_.resize(pool_.size() + capacity);
        std::copy_n(pool_.begin() + block.offset, block.count, pool_.begin() + moved);
        block.offset = moved;
        block.capacity = capacity;
    }
    pool_[block.offset + block.count++] = t;
    changed_[at(v)] = kChanged;
}

void LiveMesh::detach(Index v, Index t) {
    auto& block = blocks_[at(v)];
    Index* const list = pool_.data() + block.offset;
    *std::find(list, list + block.count, t) = list[block.count - 1];
    --block.count;
    changed_[at(v)] = kChanged;
}

void LiveMesh::fill_slot(Index t, const Tet& tet) {
    tets_[at(t)] = tet;
    for (const Index v : tet) {
        attach(v, t);
    }
}

Index LiveMesh::add(const Tet& tet) {
    const Index t = index(tets_.size());
    tets_.push_back(tet);
    fill_slot(t, tet);
    if (recording_) {
        journal_.push_back({.change = Change::Added, .id = t, .tet = tet});
    }
    return t;
}

void LiveMesh::remove(Index t) {
    const Tet tet = tets_[at(t)];
    for (const Index v : tet) {
        detach(v, t);
    }
    tets_[at(t)][0] = kNone;
    if (recording_) {
        journal_.push_back({.change = Change::Removed, .id = t, .tet = tet});
    }
}

void LiveMesh::restore(Index t, const Tet& tet) {
    fill_slot(t, tet);
    if (recording_) {
        journal_.pop_back();
    }
}

void LiveMesh::begin() {
    journal_.clear();
    recording_ = true;
    first_vertex_ = points_.size();
    first_slot_ = tets_.size();
}

void LiveMesh::commit() {
    recording_ = false;
    journal_.clear();
}

void LiveMesh::roll_back() {
    recording_ = false;
    for (auto record = journal_.rbegin(); record != journal_.rend(); ++record) {
        switch (record->change) {
            case Change::Added: remove(record->id); break;
            case Change::Removed: fill_slot(record->id, record->tet); break;
            case Change::Moved:
                move(record->id, record->point, record->anchor);
                kinds_[at(record->id)] = record->kind;
                break;
        }
    }
    journal_.clear();
    points_.resize(first_vertex_);
    kinds_.resize(first_vertex_);
    anchors_.resize(first_vertex_);
    locked_.resize(first_vertex_);
    changed_.resize(first_vertex_);
    blocks_.resize(first_vertex_);
    tets_.resize(first_slot_);
}

void LiveMesh::record_place(Index v) {
    if (recording_) {
        journal_.push_back({.change = Change::Moved,
                            .id = v,
                            .point = points_[at(v)],
                            .anchor = anchors_[at(v)],
                            .kind = kinds_[at(v)]});
    }
    changed_[at(v)] = kChanged;
}

void LiveMesh::move_recorded(Index v, const Vec3& point, Index anchor) {
    record_place(v);
    move(v, point, anchor);
}

void LiveMesh::bury(Index v) {
    record_place(v);
    kinds_[at(v)] = ParticleKind::Volume;
    anchors_[at(v)] = kNone;
}

void LiveMesh::touched(std::vector<Index>& tets) const {
    tets.clear();
    for (const auto& record : journal_) {
        if (record.change == Change::Added && is_alive(record.id)) {
            tets.push_back(record.id);
        } else if (record.change == Change::Moved) {
            const auto star = around(record.id);
            tets.insert(tets.end(), star.begin(), star.end());
        }
    }
    std::sort(tets.begin(), tets.end());
    tets.erase(std::unique(tets.begin(), tets.end()), tets.end());
}

bool LiveMesh::is_boundary_face(Index t, std::size_t corner) const {
    const Index a = tet(t)[kFaces[corner][0]];
    const Index b = tet(t)[kFaces[corner][1]];
    const Index c = tet(t)[kFaces[corner][2]];
    const auto others = around(a);
    return on_boundary(a) && on_boundary(b) && on_boundary(c) &&
           std::none_of(others.begin(), others.end(),
                        [&](Index s) { return s != t && has(tet(s), b) && has(tet(s), c); });
}

void LiveMesh::boundary_fan(Index v, std::vector<LinkEdge>& edges) const {
    edges.clear();
    for (const Index t : around(v)) {
        const auto& tet = tets_[at(t)];
        const auto corner =
            static_cast<std::size_t>(std::find(tet.begin(), tet.end(), v) - tet.begin());
        const auto& order = kToFront[corner];
        // Faces of the tet (v, b, c, d) at v, outward: (v, c, b), (v, d, c), (v, b, d).
        const Index b = tet[order[1]];
        const Index c = tet[order[2]];
        const Index d = tet[order[3]];
        for (const LinkEdge& edge : {LinkEdge{c, b}, LinkEdge{d, c}, LinkEdge{b, d}}) {
            if (!on_boundary(edge.from) || !on_boundary(edge.to)) {
                continue;
            }
            const auto twin = std::find_if(edges.begin(), edges.end(), [&](const LinkEdge& e) {
                return e.from == edge.to && e.to == edge.from;
            });
            if (twin == edges.end()) {
                edges.push_back(edge);
            } else {
                *twin = edges.back();
                edges.pop_back();
            }
        }
    }
}

bool LiveMesh::is_one_fan(Index v) const {
    std::vector<LinkEdge> edges;
    boundary_fan(v, edges);
    if (edges.empty()) {
        return true;
    }
    Index current = edges.front().from;
    for (std::size_t step = 0; step < edges.size(); ++step) {
        Index next = kNone;
        for (const auto& edge : edges) {
            if (edge.from == current) {
                if (next != kNone) {
                    return false;
                }
                next = edge.to;
            }
        }
        if (next == kNone || (next == edges.front().from && step + 1 < edges.size())) {
            return false;
        }
        current = next;
    }
    return current == edges.front().from;
}

}  // namespace remesh::improve
