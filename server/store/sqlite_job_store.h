#pragma once

#include <filesystem>
#include <memory>

#include "server/store/job_store.h"

namespace remesh {

/// Opens or creates a store in one SQLite file (WAL, synchronous=FULL: what was answered is on
/// disk). The caller owns the directory alone.
///
/// \throws StoreError if the file is damaged or was written by a newer version
std::unique_ptr<JobStore> open_sqlite_store(const std::filesystem::path& file);

}  // namespace remesh
