#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace remesh {

using Vec3 = Eigen::Vector3d;
using Index =
    std::int32_t;  ///< Of a vertex, triangle, tet or particle. Never negative but for kNone.
inline constexpr Index kNone = -1;

using Points = std::vector<Vec3>;       ///< #P positions, model units.
using Triangle = std::array<Index, 3>;  ///< Counter-clockwise seen from outside.
using Tet = std::array<Index, 4>;       ///< (b-a) . ((c-a) x (d-a)) > 0.

/// Triangles over shared vertices. What is read from a file may break every promise a surface
/// makes.
struct SurfaceMesh {
    Points vertices{};                       ///< #V, model units.
    std::vector<Triangle> triangles{};       ///< #T.
    std::vector<std::int32_t> patch{};       ///< #T ids of named parts of the surface, or empty.
    std::vector<std::string> patch_names{};  ///< Name of patch i, or empty.
};

/// Tetrahedra over shared vertices.
struct TetMesh {
    Points vertices{};                   ///< #V, model units.
    std::vector<Tet> tets{};             ///< #T, positively oriented.
    std::vector<std::int32_t> region{};  ///< #T region of each tet, or empty: all in region 1.
};

/// An axis-parallel box, model units.
struct Box {
    Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
    Vec3 high = Vec3::Constant(-std::numeric_limits<double>::infinity());

    void include(const Vec3& point) {
        low = low.cwiseMin(point);
        high = high.cwiseMax(point);
    }
    [[nodiscard]] bool is_empty() const { return !(low.array() <= high.array()).all(); }
    [[nodiscard]] double diagonal() const { return is_empty() ? 0.0 : (high - low).norm(); }
};

/// Box around all vertices, used by a triangle or not.
[[nodiscard]] Box bounding_box(const Points& points);

/// Triangles that belong to exactly one tet, facing outward, sorted by their tet's index and then
/// by the corner they lie opposite of. `owner`, if asked for, gets the tet of each.
[[nodiscard]] std::vector<Triangle> boundary_of(const std::vector<Tet>& tets,
                                                std::vector<Index>* owner = nullptr);

/// The boundary of a tet mesh as a surface of its own, with unused vertices left out.
/// Vertices keep the order that they have in the tet mesh.
/// \param triangles  boundary_of(mesh.tets), where they are known
[[nodiscard]] SurfaceMesh boundary_surface(const TetMesh& mesh, std::vector<Triangle> triangles);
[[nodiscard]] inline SurfaceMesh boundary_surface(const TetMesh& mesh) {
    return boundary_surface(mesh, boundary_of(mesh.tets));
}

}  // namespace remesh
