#pragma once

#include <string>

namespace remesh {

/// Asks a server's gRPC health service. \return whether it says SERVING within three seconds
[[nodiscard]] bool is_serving(const std::string& address, const std::string& tls_ca = {});

}  // namespace remesh
