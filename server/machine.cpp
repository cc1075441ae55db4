#include "server/machine.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <thread>
#include <unistd.h>

namespace remesh {

int processors_of_quota(const std::string& cpu_max) {
    std::istringstream in(cpu_max);
    double quota = 0.0;
    double period = 0.0;
    if (!(in >> quota >> period) || quota <= 0.0 || period <= 0.0) {
        return 0;
    }
    return static_cast<int>(std::ceil(quota / period));
}

int available_processors() {
    const int machine = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    std::ifstream file("/sys/fs/cgroup/cpu.max");
    std::string line;
    std::getline(file, line);
    const int quota = processors_of_quota(line);
    return quota > 0 ? std::min(quota, machine) : machine;
}

std::int64_t bytes_of_limit(const std::string& memory_max) {
    std::istringstream in(memory_max);
    std::int64_t bytes = 0;
    return in >> bytes && bytes > 0 ? bytes : 0;
}

std::int64_t available_memory() {
    const std::int64_t machine =
        static_cast<std::int64_t>(::sysconf(_SC_PHYS_PAGES)) * ::sysconf(_SC_PAGESIZE);
    std::ifstream file("/sys/fs/cgroup/memory.max");
    std::string line;
    std::getline(file, line);
    const std::int64_t limit = bytes_of_limit(line);
    return limit > 0 ? std::min(limit, machine) : machine;
}

bool is_address(const std::string& address) {
    if (address.starts_with("unix:")) {
        return address.size() > 5;
    }
    const auto colon = address.rfind(':');
    if (colon == std::string::npos || colon == 0) {
        return false;
    }
    const std::string port = address.substr(colon + 1);
    return !port.empty() && port.size() <= 5 &&
           port.find_first_not_of("0123456789") == std::string::npos && std::stoi(port) <= 65'535;
}

bool is_loopback(const std::string& address) {
    const std::string host = address.substr(0, address.rfind(':'));
    const bool is_number = host.find_first_not_of("0123456789.") == std::string::npos;
    return address.starts_with("unix:") || (is_number && host.starts_with("127.")) ||
           host == "localhost" || host == "[::1]";
}

}  // namespace remesh
