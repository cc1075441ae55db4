#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/geometry/domain.h"
#include "core/geometry/size_image.h"
#include "core/geometry/sizing_field.h"
#include "core/run_context.h"
#include "core/stages/features.h"

namespace remesh {

class CoupledSizing;

/// Edges of `first_size` on the boundary, which grow by `growth` from one layer of elements to the
/// next: h = first_size + (growth - 1) / 0.85 * distance, since a layer is 0.85 edges high.
struct BoundaryLayer {
    double first_size = 0.0;  ///< Edge length on the boundary, model units, > 0.
    double growth = 1.2;      ///< In (1, 1.25].
};

/// Places where a size may be wanted.
struct SizingPoints {
    Points points{};  ///< 1 to 100,000.
};
struct SizingPolyline {
    Points points{};  ///< 2 to 100,000; closed if the first is given again at the end.
};
struct SizingSphere {
    Vec3 center = Vec3::Zero();
    double radius = 0.0;  ///< Model units, >= 0.
};
struct SizingBox {
    Vec3 low = Vec3::Zero();
    Vec3 high = Vec3::Zero();  ///< >= low.
};

/// The size that is wanted in a place, and how it grows around it.
struct SizingRegion {
    std::variant<SizingPoints, SizingPolyline, SizingSphere, SizingBox> shape{};
    double size = 0.0;  ///< Edge length there, model units, > 0.
    std::optional<double>
        growth{};  ///< Around it, from one layer to the next, in (1, 1.25]; absent: by gradation.
};

/// How sizes spread from where they are asked for.
enum class Propagation {
    Lipschitz,  ///< h grows by the gradation, exactly: the coarsest map that honours all demands.
    Multigrid,  ///< Also, dc/dt = div grad c + R c with c = ln(max_size / h), the paper's
                ///< diffusion, to its steady state on a coarse uniform mesh of the body.
    Coupled,    ///< The same on the particles themselves, a step each time they are repopulated.
};

/// What asks for smaller edges than usual, and where. All demands are combined by their minimum.
struct SizingOptions {
    bool guard_thickness =
        true;  ///< Refine where the body, or the gap beside it, is thinner than about 1.4 h.
    double min_factor = 0.5;  ///< The guard refines to no less than this times h, in (0, 1].

    std::optional<double> min_size{};  ///< Lower clamp, model units, > 0. Absent: a tenth of
                                       ///< max_size, or less where a region or layer asks for it.
    std::optional<double> max_size{};  ///< Where nothing asks for less. Absent: the edge length.
    double gradation = 0.2;  ///< How fast h may grow with distance, in (0, 0.3]; a region or layer
                             ///< with a growth of its own has its own.
    Propagation propagation = Propagation::Lipschitz;
    std::optional<double> reaction{};  ///< R of the diffusion, 1 / (model unit)^2, < 0, as there is
                                       ///< no steady state otherwise: sizes spread over
                                       ///< 1 / sqrt(-R). Absent: by gradation and sizes.

    std::optional<double> chord_error{};      ///< Curvature: edges may leave the surface by this
                                              ///< much, model units, > 0.
    std::optional<double> elements_across{};  ///< Thickness: edges across the body, in [1, 16].
    std::optional<BoundaryLayer> layer{};
    std::vector<SizingRegion> regions{};  ///< At most 1000.
    std::string vertex_field{};  ///< Scalar of the input's vertices that is their size; or empty.
    std::shared_ptr<const SizeImage> image{};  ///< Sizes in space, or none.

    bool return_field = false;  ///< Give h(x) at the vertices of the result.

    /// Whether anything but the guard may make h vary.
    [[nodiscard]] bool is_graded() const {
        return chord_error || elements_across || layer || !regions.empty() ||
               !vertex_field.empty() || image;
    }
};

/// Wanted edge lengths at the vertices of the input.
struct VertexSizes {
    const SurfaceMesh* input = nullptr;
    std::vector<double> sizes{};  ///< #V, model units, > 0, or NaN for no wish.
};

/// h(x), and how it goes on.
struct SizingMap {
    std::shared_ptr<const SizingField> field{};
    std::shared_ptr<CoupledSizing> coupled{};  ///< The field itself where it diffuses on particles.
};

/// Builds h(x): uniform, or refined where the options ask for it and graded from there.
///
/// The field keeps a reference to `domain`.
///
/// \param edge_length  h where nothing asks for another, model units, > 0
/// \param wishes       needed if options.vertex_field is named
/// \throws Error{InvalidInput} if an option is out of range, or the image lies elsewhere
SizingMap build_sizing_field(const Domain& domain, const FeatureSet& features, double edge_length,
                             const SizingOptions& options, RunContext& run,
                             const VertexSizes& wishes = {});

/// options.min_size, or what it is if absent. \param edge_length  h where nothing asks for another
double min_size_of(const SizingOptions& options, double edge_length);

/// \param edge_length  if known, for what depends on it
/// \throws Error{InvalidInput} naming the field, its range and the value
void validate(const SizingOptions& options, std::optional<double> edge_length = {});

}  // namespace remesh
