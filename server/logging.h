#pragma once

#include <string>

namespace remesh {

/// One line an event to stderr, from a level on: debug, info, warn or error.
void set_up_log(const std::string& level);

}  // namespace remesh
