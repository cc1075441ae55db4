#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/stages/report.h"

namespace remesh {

/// What a result must keep, or the job has failed; absent: anything goes.
struct BoundOptions {
    /// Of all tets, degrees, in (0, 70.5]: a regular tet has 70.53.
    std::optional<double> min_dihedral{};
    /// Largest distance between the surfaces before and after, either way, model units, > 0.
    std::optional<double> max_deviation{};
    /// |after - before| / before of the enclosed volume, > 0.
    std::optional<double> max_volume_change{};
};

/// Compares a report with the bounds asked for, in the order of `BoundOptions`.
[[nodiscard]] std::vector<BoundCheck> check_bounds(const QualityReport& report,
                                                   const BoundOptions& bounds);

/// "min_dihedral is 24.1 degrees, the bound is 27; ..." of those that don't hold; else empty.
[[nodiscard]] std::string broken_bounds(const std::vector<BoundCheck>& checks);

/// \param tetrahedra  whether the job makes any
/// \throws Error{InvalidInput} naming the field, its range and the value
void validate(const BoundOptions& bounds, bool tetrahedra);

}  // namespace remesh
