#include "core/mesh/mesh.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/mesh/tet_corners.h"

namespace remesh {
namespace {

/// A face by its two larger corners; faces with the same smallest corner are looked at together.
struct Face {
    std::uint64_t larger;  // Middle and largest corner.
    std::uint32_t id;      // 4 * tet + corner.
};

std::array<Index, 3> corners_of(const std::vector<Tet>& tets, std::uint32_t id) {
    const auto& tet = tets[id / 4];
    const auto& face = kFaces[id % 4];
    return {tet[face[0]], tet[face[1]], tet[face[2]]};
}

/// Ids of all faces, grouped by their smallest corner: those of vertex v stand from first[v] on.
struct FaceTable {
    std::vector<std::uint32_t> first{};
    std::vector<std::uint32_t> ids{};

    explicit FaceTable(const std::vector<Tet>& tets) {
        Index largest = kNone;
        for (const auto& tet : tets) {
            largest = std::max(largest, *std::max_element(tet.begin(), tet.end()));
        }
        first.assign(static_cast<std::size_t>(largest) + 2, 0);
        const auto faces = static_cast<std::uint32_t>(4 * tets.size());
        const auto smallest = [&](std::uint32_t id) {
            const auto corners = corners_of(tets, id);
            return static_cast<std::size_t>(*std::min_element(corners.begin(), corners.end()));
        };
        for (std::uint32_t id = 0; id < faces; ++id) {
            ++first[smallest(id) + 1];
        }
        std::partial_sum(first.begin(), first.end(), first.begin());
        ids.resize(faces);
        std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
        for (std::uint32_t id = 0; id < faces; ++id) {
            ids[next[smallest(id)]++] = id;
        }
    }
};

/// Appends those faces of one group that no other has the corners of.
void append_single(std::vector<Face>& group, std::vector<std::uint32_t>& single) {
    std::sort(group.begin(), group.end(), [](const Face& a, const Face& b) {
        return a.larger != b.larger ? a.larger < b.larger : a.id < b.id;
    });
    for (std::size_t i = 0; i < group.size();) {
        std::size_t j = i + 1;
        while (j < group.size() && group[j].larger == group[i].larger) {
            ++j;
        }
        if (j - i == 1) {
            single.push_back(group[i].id);
        }
        i = j;
    }
}

}  // namespace

Box bounding_box(const Points& points) {
    Box box;
    for (const auto& point : points) {
        box.include(point);
    }
    return box;
}

std::vector<Triangle> boundary_of(const std::vector<Tet>& tets, std::vector<Index>* owner) {
    const FaceTable table(tets);
    std::vector<std::uint32_t> single;
    std::vector<Face> group;
    for (std::size_t v = 0; v + 1 < table.first.size(); ++v) {
        group.clear();
        for (std::uint32_t k = table.first[v]; k < table.first[v + 1]; ++k) {
            auto corners = corners_of(tets, table.ids[k]);
            std::sort(corners.begin(), corners.end());
            group.push_back({static_cast<std::uint64_t>(corners[1]) << 32 |
                                 static_cast<std::uint64_t>(corners[2]),
                             table.ids[k]});
        }
        append_single(group, single);
    }
    std::sort(single.begin(), single.end());

    std::vector<Triangle> triangles;
    triangles.reserve(single.size());
    if (owner != nullptr) {
        owner->clear();
        owner->reserve(single.size());
    }
    for (const auto id : single) {
        triangles.push_back(corners_of(tets, id));
        if (owner != nullptr) {
            owner->push_back(static_cast<Index>(id / 4));
        }
    }
    return triangles;
}

SurfaceMesh boundary_surface(const TetMesh& mesh, std::vector<Triangle> triangles) {
    SurfaceMesh surface;
    surface.triangles = std::move(triangles);
    std::vector<Index> renumbered(mesh.vertices.size(), kNone);
    for (const auto& triangle : surface.triangles) {
        for (const auto v : triangle) {
            renumbered[static_cast<std::size_t>(v)] = 0;
        }
    }
    for (std::size_t v = 0; v < renumbered.size(); ++v) {
        if (renumbered[v] != kNone) {
            renumbered[v] = static_cast<Index>(surface.vertices.size());
            surface.vertices.push_back(mesh.vertices[v]);
        }
    }
    for (auto& triangle : surface.triangles) {
        for (auto& v : triangle) {
            v = renumbered[static_cast<std::size_t>(v)];
        }
    }
    return surface;
}

}  // namespace remesh
