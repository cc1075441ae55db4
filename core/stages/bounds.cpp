#include "core/stages/bounds.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "core/error.h"

namespace remesh {
namespace {

void require(bool condition, const char* field, const char* range, double value) {
    if (!condition) {
        std::ostringstream text;
        text << "bounds." << field << " must be " << range << ", got " << value;
        throw Error(ErrorCode::InvalidInput, text.str());
    }
}

void require_positive(const std::optional<double>& value, const char* field) {
    if (value) {
        require(std::isfinite(*value) && *value > 0.0, field, "> 0 and finite", *value);
    }
}

}  // namespace

std::vector<BoundCheck> check_bounds(const QualityReport& report, const BoundOptions& bounds) {
    std::vector<BoundCheck> checks;
    if (bounds.min_dihedral) {
        const double value = report.tets ? report.tets->min_dihedral : 0.0;
        checks.push_back(
            {"min_dihedral", *bounds.min_dihedral, value, value >= *bounds.min_dihedral});
    }
    if (bounds.max_deviation) {
        const double value = std::max(report.output_to_input.max, report.input_to_output.max);
        checks.push_back(
            {"max_deviation", *bounds.max_deviation, value, value <= *bounds.max_deviation});
    }
    if (bounds.max_volume_change) {
        const double value = std::abs(report.volume_change);
        checks.push_back({"max_volume_change", *bounds.max_volume_change, value,
                          value <= *bounds.max_volume_change});
    }
    return checks;
}

std::string broken_bounds(const std::vector<BoundCheck>& checks) {
    std::ostringstream text;
    for (const BoundCheck& check : checks) {
        if (!check.holds) {
            text << (text.tellp() > 0 ? "; " : "") << check.name << " is " << check.value
                 << ", the bound is " << check.bound;
        }
    }
    return text.str();
}

void validate(const BoundOptions& bounds, bool tetrahedra) {
    if (bounds.min_dihedral) {
        require(*bounds.min_dihedral > 0.0 && *bounds.min_dihedral <= 70.5, "min_dihedral",
                "in (0, 70.5]", *bounds.min_dihedral);
        require(tetrahedra, "min_dihedral", "absent in a job without tetrahedra",
                *bounds.min_dihedral);
    }
    require_positive(bounds.max_deviation, "max_deviation");
    require_positive(bounds.max_volume_change, "max_volume_change");
}

}  // namespace remesh
