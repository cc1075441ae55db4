#include "server/jobs/process_memory.h"

#include <sys/resource.h>

#include <fstream>
#include <unistd.h>

namespace remesh {

std::int64_t resident_bytes() {
    std::ifstream file("/proc/self/statm");
    std::int64_t total = 0;
    std::int64_t resident = 0;
    file >> total >> resident;
    return file ? resident * ::sysconf(_SC_PAGESIZE) : 0;
}

void limit_process_memory([[maybe_unused]] std::int64_t bytes) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    const rlimit limit{static_cast<rlim_t>(bytes), static_cast<rlim_t>(bytes)};
    ::setrlimit(RLIMIT_DATA, &limit);
#endif
}

}  // namespace remesh
