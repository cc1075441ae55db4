#pragma once

#include <filesystem>

#include "server/store/sqlite.h"

namespace remesh {

/// Opens `access.sqlite` of a data directory, which holds the credentials and the audit log, and
/// makes it (mode 0600) if it isn't there. Several processes may have it open.
///
/// \throws StoreError if it can't be used or was written by a newer version
[[nodiscard]] sqlite::Connection open_access_database(const std::filesystem::path& data_dir);

}  // namespace remesh
