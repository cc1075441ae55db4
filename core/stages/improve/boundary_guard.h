#pragma once

#include <vector>

#include "core/stages/improve/part.h"

namespace remesh::improve {

/// Knows the boundary around a part of a mesh, so that what changes in the part can be kept from
/// crossing it.
class BoundaryGuard {
public:
    BoundaryGuard(const Whole& whole, const Part& part);

    /// Whether no boundary face of some tets of the part crosses or touches another one, in the
    /// part or out of it. Exact.
    [[nodiscard]] bool allows(const LiveMesh& mesh, const std::vector<Index>& tets) const;

private:
    struct Face {
        std::array<Vec3, 3> corners;
        std::array<Index, 3> ids;
    };
    // Boundary faces of the part that may change, as far as they meet a box.
    void add_faces_near(const LiveMesh& mesh, const Box& box, std::vector<Face>& faces) const;
    [[nodiscard]] Face face_of(const LiveMesh& mesh, Index t, std::size_t corner) const;

    std::vector<Face> still_{};  // Faces with no vertex that may move.
    const std::vector<Index>& origin_;
    Index whole_count_;
};

}  // namespace remesh::improve
