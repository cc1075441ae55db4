#pragma once

#include <cstdint>
#include <string>

namespace remesh {

/// Processors that this process may use: the cgroup's quota (cpu.max) if there is one, else the
/// machine's; at least 1.
[[nodiscard]] int available_processors();

/// What a cpu.max file grants, rounded up; 0 if it says "max" or can't be understood.
[[nodiscard]] int processors_of_quota(const std::string& cpu_max);

/// Memory that this process and its children may use, bytes: the cgroup's limit (memory.max) if
/// there is one, else the machine's.
[[nodiscard]] std::int64_t available_memory();

/// What a memory.max file grants; 0 if it says "max" or can't be understood.
[[nodiscard]] std::int64_t bytes_of_limit(const std::string& memory_max);

/// Whether it is HOST:PORT, a port in [0, 65535], or unix:PATH.
[[nodiscard]] bool is_address(const std::string& address);

/// Whether HOST:PORT or unix:PATH can only be reached from this machine.
[[nodiscard]] bool is_loopback(const std::string& address);

}  // namespace remesh
