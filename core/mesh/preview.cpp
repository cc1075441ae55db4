#include "core/mesh/preview.h"

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Core/System/omstream.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include <utility>

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

}  // namespace remesh
