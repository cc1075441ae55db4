#include "server/http/assets.h"

namespace remesh::http {

std::span<const Asset> dashboard_assets() {
    return {};
}

}  // namespace remesh::http
