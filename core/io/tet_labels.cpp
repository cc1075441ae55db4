#include "core/io/tet_labels.h"

#include <algorithm>

#include "core/error.h"

namespace remesh::io {

LabelledTets::LabelledTets(const TetMesh& tets)
    : mesh(tets), boundary(boundary_of(tets.tets, &owner)) {
    for (const std::int32_t region : mesh.region) {
        // Neighbours are mostly of one region, so this is one comparison for nearly all.
        if (regions.empty() || region != regions.back()) {
            const auto place = std::lower_bound(regions.begin(), regions.end(), region);
            if (place == regions.end() || *place != region) {
                regions.insert(place, region);
            }
        }
    }
    if (regions.empty()) {
        regions.push_back(1);
    }
    if (regions.front() < 1) {
        throw Error(ErrorCode::InvalidInput,
                    "regions must be numbered from 1 on, got " + std::to_string(regions.front()));
    }
}

}  // namespace remesh::io
