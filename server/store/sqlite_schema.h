#pragma once

#include <cstddef>

#include "server/store/sqlite.h"

namespace remesh::sqlite {

/// Brings the schema to this version in one step that happens wholly or not at all, whichever
/// process comes first.
/// \throws StoreError if the file belongs to another program or a newer version
void migrate(Connection& connection);

/// \throws StoreError if the file belongs to another program or a newer version
void require_own(Connection& connection);

}  // namespace remesh::sqlite
