#pragma once

#include <string>
#include <string_view>

#include "remesh/v1/job.pb.h"

namespace remesh {

/// What `bytes_of` or `canonical_spec` gave. \throws StoreError for anything else
[[nodiscard]] v1::JobSpec parse_spec(std::string_view bytes);
/// Equal for equal specs.
[[nodiscard]] std::string bytes_of(const v1::JobSpec& spec);

}  // namespace remesh
