#pragma once

#include <memory>

#include "core/geometry/size_image.h"
#include "core/geometry/sizing_source.h"
#include "core/run_context.h"

namespace remesh {

/// What an image asks for: its sizes, interpolated between the centres of voxels, within 4 %.
///
/// A point has a wish if the voxel that it lies in has one. Where sizes hardly change, voxels are
/// joined to blocks; where voxels are larger than the sizes that change in them, they are divided.
/// Warns of SIZE_IMAGE_COVERAGE if parts of the surface lie outside the image, or nearly all would
/// lie inside if it were turned from LPS to RAS, and of SIZE_IMAGE_EMPTY if the image asks for
/// nothing there.
///
/// \param h_min, h_max  sizes are clamped to; what isn't below h_max is no wish
/// \throws Error{InvalidInput} if the image and the surface lie apart
/// \throws Error{TooLarge} if its sizes change in more than 16 million places
std::shared_ptr<const SizingSource> make_image_source(const SizeImage& image,
                                                      const SurfaceMesh& surface, double gradation,
                                                      double h_min, double h_max, RunContext& run);

/// \throws Error{InvalidInput} if the image and the surface lie apart, saying where each is
void require_overlap(const SizeImage& image, const SurfaceMesh& surface);

/// Mean of 1 / h^3 over the voxels of an image that lie in a box: what the number of tets in it
/// goes by. Sizes are clamped to [h_min, h_max], and h_max where there is no wish.
double mean_density(const SizeImage& image, const Box& box, double h_min, double h_max);

}  // namespace remesh
