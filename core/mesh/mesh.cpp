#include "core/mesh/mesh.h"

#include <algorithm>

namespace remesh {
namespace {

// Faces of a tet, each facing away from the corner it lies opposite of.
constexpr std::array<std::array<int, 3>, 4> kFaces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

struct Face {
    std::array<Index, 3> key;  // Sorted corners.
    std::uint32_t id;          // 4 * tet + corner.

    bool operator<(const Face& other) const {
        return key != other.key ? key < other.key : id < other.id;
    }
};

}  // namespace

Box bounding_box(const Points& points) {
    Box box;
    for (const auto& point : points) {
        box.include(point);
    }
    return box;
}

std::vector<Triangle> boundary_of(const std::vector<Tet>& tets, std::vector<Index>* owner) {
    std::vector<Face> faces;
    faces.reserve(tets.size() * 4);
    for (std::size_t t = 0; t < tets.size(); ++t) {
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const auto& face = kFaces[corner];
            std::array<Index, 3> key{tets[t][static_cast<std::size_t>(face[0])],
                                     tets[t][static_cast<std::size_t>(face[1])],
                                     tets[t][static_cast<std::size_t>(face[2])]};
            std::sort(key.begin(), key.end());
            faces.push_back({key, static_cast<std::uint32_t>(4 * t + corner)});
        }
    }
    std::sort(faces.begin(), faces.end());

    std::vector<std::uint32_t> single;
    for (std::size_t i = 0; i < faces.size();) {
        std::size_t j = i + 1;
        while (j < faces.size() && faces[j].key == faces[i].key) {
            ++j;
        }
        if (j - i == 1) {
            single.push_back(faces[i].id);
        }
        i = j;
    }
    std::sort(single.begin(), single.end());

    std::vector<Triangle> triangles;
    triangles.reserve(single.size());
    if (owner != nullptr) {
        owner->clear();
        owner->reserve(single.size());
    }
    for (const auto id : single) {
        const auto& tet = tets[id / 4];
        const auto& face = kFaces[id % 4];
        triangles.push_back({tet[static_cast<std::size_t>(face[0])],
                             tet[static_cast<std::size_t>(face[1])],
                             tet[static_cast<std::size_t>(face[2])]});
        if (owner != nullptr) {
            owner->push_back(static_cast<Index>(id / 4));
        }
    }
    return triangles;
}

SurfaceMesh boundary_surface(const TetMesh& mesh) {
    SurfaceMesh surface;
    surface.triangles = boundary_of(mesh.tets);
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
