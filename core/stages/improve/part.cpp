#include "core/stages/improve/part.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"
#include "core/stages/improve/measures.h"

namespace remesh::improve {
namespace {

// Vertices of tets this many steps away from the boundary still move.
constexpr std::uint8_t kDepth = 3;
constexpr std::uint8_t kFar = 255;

// Steps along tets from the boundary, as far as `most`.
std::vector<std::uint8_t> depths(const Whole& whole, std::uint8_t most) {
    const auto& tets = whole.mesh.tets;
    std::vector<std::uint8_t> depth(whole.mesh.vertices.size(), kFar);
    for (std::size_t v = 0; v < depth.size(); ++v) {
        if (whole.kind[v] != ParticleKind::Volume) {
            depth[v] = 0;
        }
    }
    for (std::uint8_t level = 0; level < most; ++level) {
        for (const auto& tet : tets) {
            const bool is_next =
                std::any_of(tet.begin(), tet.end(), [&](Index v) { return depth[at(v)] == level; });
            for (const Index v : tet) {
                if (is_next && depth[at(v)] == kFar) {
                    depth[at(v)] = static_cast<std::uint8_t>(level + 1);
                }
            }
        }
    }
    return depth;
}

// The same, or from bad tets, which count as `kDepth - 1` deep.
std::vector<std::uint8_t> depths_of_poor(const Whole& whole, double limit, const RunContext& run) {
    const auto& tets = whole.mesh.tets;
    auto depth = depths(whole, kDepth - 1);
    const auto& points = whole.mesh.vertices;
    std::vector<std::uint8_t> is_bad(tets.size(), 0);
    for_each_index(tets.size(), run, [&](std::size_t t) {
        const auto& tet = tets[t];
        const bool is_near =
            std::all_of(tet.begin(), tet.end(), [&](Index v) { return depth[at(v)] != kFar; });
        is_bad[t] = !is_near && tet_radius_ratio(points[at(tet[0])], points[at(tet[1])],
                                                 points[at(tet[2])], points[at(tet[3])]) < limit;
    });
    for (std::size_t t = 0; t < tets.size(); ++t) {
        if (is_bad[t]) {
            for (const Index v : tets[t]) {
                depth[at(v)] = std::min<std::uint8_t>(depth[at(v)], kDepth - 1);
            }
        }
    }
    return depth;
}

// Spreads the low 21 bits to every third bit.
std::uint64_t spread(std::uint64_t x) {
    x &= 0x1FFFFF;
    x = (x | x << 32) & 0x1F00000000FFFF;
    x = (x | x << 16) & 0x1F0000FF0000FF;
    x = (x | x << 8) & 0x100F00F00F00F00F;
    x = (x | x << 4) & 0x10C30C30C30C30C3;
    x = (x | x << 2) & 0x1249249249249249;
    return x;
}

// Ids of the wanted vertices along a Z-order curve.
std::vector<Index> along_curve(const Points& points, const std::vector<std::uint8_t>& wanted) {
    const Box box = bounding_box(points);
    const double scale = 2097151.0 / std::max((box.high - box.low).maxCoeff(), 1e-300);
    std::vector<std::pair<std::uint64_t, Index>> keys;
    for (std::size_t v = 0; v < points.size(); ++v) {
        if (wanted[v]) {
            const Vec3 cell = (points[v] - box.low) * scale;
            keys.emplace_back(spread(static_cast<std::uint64_t>(cell.x())) |
                                  spread(static_cast<std::uint64_t>(cell.y())) << 1 |
                                  spread(static_cast<std::uint64_t>(cell.z())) << 2,
                              index(v));
        }
    }
    std::sort(keys.begin(), keys.end());
    std::vector<Index> ids;
    ids.reserve(keys.size());
    for (const auto& [key, id] : keys) {
        ids.push_back(id);
    }
    return ids;
}

// Appends tets by their first vertex along the curve.
void append_sorted(std::vector<Tet> tets, LiveMesh& mesh) {
    std::vector<std::size_t> begin(mesh.vertex_count() + 1, 0);
    const auto first = [](const Tet& tet) { return at(*std::min_element(tet.begin(), tet.end())); };
    for (const auto& tet : tets) {
        ++begin[first(tet) + 1];
    }
    for (std::size_t v = 1; v < begin.size(); ++v) {
        begin[v] += begin[v - 1];
    }
    std::vector<Index> order(tets.size());
    for (std::size_t t = 0; t < tets.size(); ++t) {
        order[begin[first(tets[t])]++] = index(t);
    }
    for (const Index t : order) {
        mesh.append_tet(tets[at(t)]);
    }
}

// All tets at vertices less than `end` deep, which alone move.
Cut cut_at(const Whole& whole, const std::vector<std::uint8_t>& depth, std::uint8_t end,
           const std::vector<std::uint8_t>& frozen) {
    Cut cut{std::vector<std::uint8_t>(whole.mesh.tets.size(), 0), frozen};
    for (std::size_t t = 0; t < cut.is_inside.size(); ++t) {
        const auto& tet = whole.mesh.tets[t];
        cut.is_inside[t] =
            std::any_of(tet.begin(), tet.end(), [&](Index v) { return depth[at(v)] < end; });
    }
    for (std::size_t v = 0; v < depth.size(); ++v) {
        cut.is_locked[v] = frozen[v] || depth[v] >= end;
    }
    return cut;
}

}  // namespace

Cut near_boundary(const Whole& whole, const std::vector<std::uint8_t>& frozen, double limit,
                  const RunContext& run) {
    return cut_at(whole, depths_of_poor(whole, limit, run), kDepth, frozen);
}

Cut at_boundary(const Whole& whole, const std::vector<std::uint8_t>& frozen) {
    constexpr std::uint8_t kShallow = 2;
    return cut_at(whole, depths(whole, kShallow - 1), kShallow, frozen);
}

Cut around(const Whole& whole, const std::vector<std::uint8_t>& wanted) {
    Cut cut{std::vector<std::uint8_t>(whole.mesh.tets.size(), 0), wanted};
    for (std::size_t t = 0; t < cut.is_inside.size(); ++t) {
        const auto& tet = whole.mesh.tets[t];
        cut.is_inside[t] =
            std::any_of(tet.begin(), tet.end(), [&](Index v) { return wanted[at(v)] != 0; });
    }
    for (auto& locked : cut.is_locked) {
        locked = locked == 0;
    }
    return cut;
}

Part cut_part(const Whole& whole, Cut cut, double tet_scale) {
    const auto& tets = whole.mesh.tets;
    Part part;
    part.is_inside = std::move(cut.is_inside);
    std::vector<std::uint8_t> used(whole.mesh.vertices.size(), 0);
    std::size_t count = 0;
    for (std::size_t t = 0; t < tets.size(); ++t) {
        count += part.is_inside[t];
        for (std::size_t k = 0; k < 4 && part.is_inside[t]; ++k) {
            used[at(tets[t][k])] = 1;
        }
    }

    part.origin = along_curve(whole.mesh.vertices, used);
    std::vector<Index> local(whole.mesh.vertices.size(), kNone);
    part.mesh.set_tet_scale(tet_scale);
    part.mesh.reserve(part.origin.size(), count);
    for (const Index v : part.origin) {
        local[at(v)] = part.mesh.add_vertex(whole.mesh.vertices[at(v)], whole.kind[at(v)],
                                            whole.anchor[at(v)], cut.is_locked[at(v)] != 0);
    }
    std::vector<Tet> inside;
    inside.reserve(count);
    for (std::size_t t = 0; t < tets.size(); ++t) {
        if (part.is_inside[t]) {
            inside.push_back({local[at(tets[t][0])], local[at(tets[t][1])], local[at(tets[t][2])],
                              local[at(tets[t][3])]});
        }
    }
    append_sorted(std::move(inside), part.mesh);
    part.mesh.build_incidence();
    return part;
}

Assembled put_back(const Whole& whole, const Part& part) {
    Assembled all{whole.mesh, whole.kind, whole.anchor};
    std::vector<Index> id = part.origin;
    for (std::size_t v = 0; v < part.mesh.vertex_count(); ++v) {
        const Index local = index(v);
        if (v < part.origin.size()) {
            all.mesh.vertices[at(id[v])] = part.mesh.point(local);
            all.kind[at(id[v])] = part.mesh.kind(local);
            all.anchor[at(id[v])] = part.mesh.anchor(local);
        } else {
            id.push_back(index(all.mesh.vertices.size()));
            all.mesh.vertices.push_back(part.mesh.point(local));
            all.kind.push_back(part.mesh.kind(local));
            all.anchor.push_back(part.mesh.anchor(local));
        }
    }
    all.mesh.tets.clear();
    for (std::size_t t = 0; t < whole.mesh.tets.size(); ++t) {
        if (!part.is_inside[t]) {
            all.mesh.tets.push_back(whole.mesh.tets[t]);
        }
    }
    for (std::size_t t = 0; t < part.mesh.slot_count(); ++t) {
        if (part.mesh.is_alive(index(t))) {
            const auto& tet = part.mesh.tet(index(t));
            all.mesh.tets.push_back(
                {id[at(tet[0])], id[at(tet[1])], id[at(tet[2])], id[at(tet[3])]});
        }
    }
    return all;
}

}  // namespace remesh::improve
