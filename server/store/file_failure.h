#pragma once

#include <cerrno>
#include <cstring>
#include <string>

#include "server/store/job_record.h"

namespace remesh {

/// \throws StoreError saying what couldn't be done and, by errno, why
[[noreturn]] inline void fail(const char* what) {
    const bool is_full = errno == ENOSPC || errno == EDQUOT || errno == EFBIG;
    throw StoreError(std::string("store: ") + what + ": " + std::strerror(errno),
                     is_full ? StoreError::Kind::Full : StoreError::Kind::Failed);
}

}  // namespace remesh
