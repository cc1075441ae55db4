#pragma once

#include <cstdint>

namespace remesh {

/// Memory that this process holds now, bytes; 0 if the system doesn't say.
[[nodiscard]] std::int64_t resident_bytes();

/// Lets allocations fail beyond `bytes`, as a net below limits that are looked at now and then.
/// Does nothing in a build with sanitizers, which map terabytes for themselves.
void limit_process_memory(std::int64_t bytes);

/// The same for everything that is mapped, files in memory and threads' stacks, too.
void limit_address_space(std::int64_t bytes);

}  // namespace remesh
