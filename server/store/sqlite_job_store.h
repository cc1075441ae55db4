#pragma once

#include <filesystem>
#include <memory>

#include "server/store/job_store.h"

namespace remesh {

/// Opens or creates a store in one SQLite file (WAL, synchronous=FULL: what was answered is on
/// disk). Any number of processes of one machine may have it open.
///
/// \throws StoreError if the file isn't a store or was written by a newer version; it stays as it
/// was
std::unique_ptr<JobStore> open_sqlite_store(const std::filesystem::path& file);

/// Reads a whole SQLite file, if there is one, without writing anything.
///
/// \throws StoreError that names the file if it is damaged or no database
void require_whole_database(const std::filesystem::path& file);

/// The same of a store's file.
///
/// \throws StoreError if it is damaged, isn't a store, or was written by a newer version
void check_sqlite_store(const std::filesystem::path& file);

}  // namespace remesh
