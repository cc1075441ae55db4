#pragma once

#include "server/store/sqlite.h"

namespace remesh::sqlite {

/// Brings the schema to this version, one committed step at a time (PRAGMA user_version).
/// \throws StoreError if it was written by a newer version
void migrate(Connection& connection);

}  // namespace remesh::sqlite
