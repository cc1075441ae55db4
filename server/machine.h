#pragma once

#include <string>

namespace remesh {

/// Processors that this process may use: the cgroup's quota (cpu.max) if there is one, else the
/// machine's; at least 1.
[[nodiscard]] int available_processors();

/// What a cpu.max file grants, rounded up; 0 if it says "max" or can't be understood.
[[nodiscard]] int processors_of_quota(const std::string& cpu_max);

/// Whether HOST:PORT or unix:PATH can only be reached from this machine.
[[nodiscard]] bool is_loopback(const std::string& address);

}  // namespace remesh
