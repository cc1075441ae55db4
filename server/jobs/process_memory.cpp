#include "server/jobs/process_memory.h"

#include <sys/resource.h>

#include <fstream>
#include <unistd.h>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define REMESH_HAS_SANITIZER
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define REMESH_HAS_SANITIZER
#endif
#endif

namespace remesh {
namespace {

template <typename Resource>
void limit([[maybe_unused]] Resource resource, [[maybe_unused]] std::int64_t bytes) {
#ifndef REMESH_HAS_SANITIZER
    const rlimit both{static_cast<rlim_t>(bytes), static_cast<rlim_t>(bytes)};
    ::setrlimit(resource, &both);
#endif
}

}  // namespace

std::int64_t resident_bytes() {
    std::ifstream file("/proc/self/statm");
    std::int64_t total = 0;
    std::int64_t resident = 0;
    file >> total >> resident;
    return file ? resident * ::sysconf(_SC_PAGESIZE) : 0;
}

void limit_process_memory(std::int64_t bytes) {
    limit(RLIMIT_DATA, bytes);
}

void limit_address_space(std::int64_t bytes) {
    limit(RLIMIT_AS, bytes);
}

}  // namespace remesh
