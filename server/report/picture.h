#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh::report {

/// What is drawn: triangles with a quality each.
struct Facets {
    std::vector<std::array<Vec3, 3>> corners{};  ///< #F, model units.
    std::vector<double> quality{};               ///< #F radius ratios: 1 blue, 0 dark red.
};

/// Where from: the rows turn model coordinates into right, up and towards the eye.
struct View {
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    Vec3 low = Vec3::Zero();  ///< Of what has to fit, in turned coordinates.
    Vec3 high = Vec3::Zero();
};

/// A surface by the radius ratios of its triangles. Triangles with a coordinate that isn't finite
/// are left out.
[[nodiscard]] Facets facets_of(const SurfaceMesh& surface);

/// The tets whose centroid is behind the middle of the view, each by its own radius ratio: the
/// inside shows.
[[nodiscard]] Facets half_of(const TetMesh& mesh, const View& view);

/// A view with the longest axis of a body upright, that all of the body fits into.
[[nodiscard]] View upright_view(const Facets& body);

/// Draws triangles lit from the upper left, with their edges where those don't blot them out.
///
/// \param height  pixels; the width follows from the view
/// \return a PNG with a transparent background
[[nodiscard]] std::string draw_png(const Facets& facets, const View& view, int height);

}  // namespace remesh::report
