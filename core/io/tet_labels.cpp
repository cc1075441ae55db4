#include "core/io/tet_labels.h"

#include <algorithm>

#include "core/error.h"
#include "core/io/patch_names.h"

namespace remesh::io {
namespace {

// Neighbours are mostly alike, so this is one comparison for nearly all.
void include(std::int32_t label, std::vector<std::int32_t>& sorted) {
    if (sorted.empty() || label != sorted.back()) {
        const auto place = std::lower_bound(sorted.begin(), sorted.end(), label);
        if (place == sorted.end() || *place != label) {
            sorted.insert(place, label);
        }
    }
}

}  // namespace

LabelledTets::LabelledTets(const TetMesh& tets, const SurfaceMesh& patches)
    : mesh(tets), surface(patches), boundary(boundary_of(tets.tets, &owner)) {
    for (const std::int32_t region : mesh.region) {
        include(region, regions);
    }
    if (regions.empty()) {
        regions.push_back(1);
    }
    if (regions.front() < 1) {
        throw Error(ErrorCode::InvalidInput,
                    "regions must be numbered from 1 on, got " + std::to_string(regions.front()));
    }
    if (!surface.patch.empty() && surface.patch.size() != boundary.size()) {
        throw Error(ErrorCode::InvalidInput,
                    "there must be a patch for each of " + std::to_string(boundary.size()) +
                        " boundary triangles, got " + std::to_string(surface.patch.size()));
    }
    for (std::size_t t = 0; t < boundary.size(); ++t) {
        include(label_of(t), labels);
    }
}

std::string LabelledTets::name_of(std::int32_t label) const {
    if (surface.patch.empty()) {
        return "boundary_" + std::to_string(label);
    }
    std::string name = patch_name(surface, label - 1);
    std::replace(name.begin(), name.end(), '"', '_');
    return name;
}

std::vector<std::int32_t> LabelledTets::labels_around(std::int32_t region) const {
    std::vector<std::int32_t> around;
    for (std::size_t t = 0; t < boundary.size(); ++t) {
        if (region_of(static_cast<std::size_t>(owner[t])) == region) {
            include(label_of(t), around);
        }
    }
    return around;
}

}  // namespace remesh::io
