#include "core/stages/rims.h"

#include <algorithm>
#include <utility>

#include "core/stages/surface_math.h"

namespace remesh {
namespace {

void measure(const SurfaceMesh& surface, Rim& rim) {
    for (const auto half : rim.edges) {
        const RimEdge edge = rim_edge(surface, half);
        rim.length += edge.length;
        rim.center += edge.length * edge.middle;
        rim.outward += edge.length * edge.outward;
    }
    rim.center /= rim.length;
    rim.outward /= rim.length;
    for (const auto half : rim.edges) {
        const RimEdge edge = rim_edge(surface, half);
        const Vec3 inward = rim.center - edge.middle;
        const double distance = inward.norm();
        rim.radius += edge.length * distance / rim.length;
        rim.far_radius = std::max(rim.far_radius, distance);
        if (distance > 0.0) {
            rim.convergence += edge.length * edge.outward.dot(inward) / (distance * rim.length);
        }
    }
}

}  // namespace

RimEdge rim_edge(const SurfaceMesh& surface, EdgeTable::HalfEdge half) {
    const std::size_t triangle = EdgeTable::triangle_of(half);
    const std::size_t k = EdgeTable::corner_of(half);
    const Vec3& a = corner(surface, triangle, k);
    const Vec3& b = corner(surface, triangle, (k + 1) % 3);
    return {.middle = 0.5 * (a + b),
            .outward = (b - a).cross(area_vector(surface, triangle)).normalized(),
            .length = (b - a).norm()};
}

Rim rim_of(const SurfaceMesh& surface, std::vector<EdgeTable::HalfEdge> edges) {
    Rim rim{.edges = std::move(edges)};
    measure(surface, rim);
    return rim;
}

std::vector<Rim> find_rims(const SurfaceMesh& surface, const EdgeTable& table) {
    DisjointSets sets(surface.vertices.size());
    for (const auto& edge : table.edges()) {
        if (edge.count == 1) {
            sets.merge(edge.low, edge.high);
        }
    }
    std::vector<Rim> rims;
    std::vector<Index> rim_of(surface.vertices.size(), kNone);
    for (const auto& edge : table.edges()) {
        if (edge.count == 1) {
            auto& number = rim_of[static_cast<std::size_t>(sets.find(edge.low))];
            if (number == kNone) {
                number = static_cast<Index>(rims.size());
                rims.emplace_back();
            }
            rims[static_cast<std::size_t>(number)].edges.push_back(table.half_edges(edge)[0]);
        }
    }
    for (Rim& rim : rims) {
        measure(surface, rim);
    }
    return rims;
}

}  // namespace remesh
