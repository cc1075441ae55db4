#include "core/mesh/preview.h"

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Core/System/omstream.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/mesh/quality.h"

namespace remesh {
namespace {

struct Traits : OpenMesh::DefaultTraits {
    using Point = OpenMesh::Vec3d;
    using Normal = OpenMesh::Vec3d;
};
using HalfEdgeMesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;

HalfEdgeMesh to_half_edges(const SurfaceMesh& surface) {
    HalfEdgeMesh mesh;
    for (const auto& v : surface.vertices) {
        mesh.add_vertex({v.x(), v.y(), v.z()});
    }
    // OpenMesh leaves out what would make a vertex or edge non-manifold, which is what we want
    // here, but says so on stderr for every face. Its streams are global: silenced once.
    [[maybe_unused]] static const bool is_quiet = (omerr().disable(), true);
    for (const auto& [a, b, c] : surface.triangles) {
        mesh.add_face(HalfEdgeMesh::VertexHandle(a), HalfEdgeMesh::VertexHandle(b),
                      HalfEdgeMesh::VertexHandle(c));
    }
    return mesh;
}

SurfaceMesh from_half_edges(HalfEdgeMesh mesh) {
    mesh.garbage_collection();
    SurfaceMesh surface;
    for (const auto v : mesh.vertices()) {
        const auto& p = mesh.point(v);
        surface.vertices.emplace_back(p[0], p[1], p[2]);
    }
    for (const auto f : mesh.faces()) {
        Triangle triangle{};
        std::size_t corner = 0;
        for (const auto v : mesh.fv_range(f)) {
            triangle[corner++] = v.idx();
        }
        surface.triangles.push_back(triangle);
    }
    return surface;
}

// Vertices in one cell of the grid become their mean; triangles that lose a corner go.
SurfaceMesh clustered(const SurfaceMesh& surface, double cell) {
    using Keyed = std::pair<std::array<std::int64_t, 3>, Index>;
    std::vector<Keyed> keyed;
    keyed.reserve(surface.vertices.size());
    for (std::size_t v = 0; v < surface.vertices.size(); ++v) {
        const Vec3 at = (surface.vertices[v] / cell).array().floor();
        keyed.push_back({{static_cast<std::int64_t>(at.x()), static_cast<std::int64_t>(at.y()),
                          static_cast<std::int64_t>(at.z())},
                         static_cast<Index>(v)});
    }
    std::sort(keyed.begin(), keyed.end());

    SurfaceMesh coarse;
    std::vector<Index> cluster_of(surface.vertices.size());
    for (std::size_t begin = 0, end = 0; begin < keyed.size(); begin = end) {
        Vec3 sum = Vec3::Zero();
        for (; end < keyed.size() && keyed[end].first == keyed[begin].first; ++end) {
            sum += surface.vertices[keyed[end].second];
            cluster_of[keyed[end].second] = static_cast<Index>(coarse.vertices.size());
        }
        coarse.vertices.push_back(sum / static_cast<double>(end - begin));
    }
    for (const auto& [a, b, c] : surface.triangles) {
        const Triangle t{cluster_of[a], cluster_of[b], cluster_of[c]};
        if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) {
            coarse.triangles.push_back(t);
        }
    }
    return coarse;
}

}  // namespace

SurfaceMesh decimate(const SurfaceMesh& surface, std::size_t max_triangles) {
    if (surface.triangles.size() <= max_triangles) {
        return surface;
    }
    HalfEdgeMesh mesh = to_half_edges(surface);
    mesh.request_vertex_status();
    mesh.request_edge_status();
    mesh.request_halfedge_status();
    mesh.request_face_status();
    mesh.request_face_normals();
    mesh.update_face_normals();

    using Decimater = OpenMesh::Decimater::DecimaterT<HalfEdgeMesh>;
    Decimater decimater(mesh);
    OpenMesh::Decimater::ModQuadricT<HalfEdgeMesh>::Handle quadric;
    decimater.add(quadric);
    decimater.module(quadric).unset_max_err();
    if (decimater.initialize()) {
        decimater.decimate_to_faces(0, max_triangles);
    }
    return from_half_edges(std::move(mesh));
}

SurfaceMesh cluster(const SurfaceMesh& surface, std::size_t max_triangles) {
    if (surface.triangles.size() <= max_triangles) {
        return surface;
    }
    // A surface crosses about 1.5 cells per cell's area, and has two triangles a vertex.
    double cell = std::sqrt(3.0 * surface_area(surface) / static_cast<double>(max_triangles));
    SurfaceMesh coarse = clustered(surface, cell);
    while (coarse.triangles.size() > max_triangles) {
        cell *= 1.15;
        coarse = clustered(surface, cell);
    }
    return coarse;
}

}  // namespace remesh
