#include "server/store/data_dir.h"

#include <sys/file.h>
#include <sys/stat.h>
#include <sys/vfs.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <unistd.h>
#include <utility>

#include "server/store/job_store.h"

namespace remesh {
namespace {

// From linux/magic.h, the kernel's and the file systems' sources: NFS, CIFS, SMB2, SMB, AFS, Ceph,
// FUSE's 9P, OCFS2, GFS2, Lustre, GPFS, BeeGFS.
constexpr std::array<unsigned long, 12> kNetworkFileSystems{
    0x6969,     0xff534d42, 0xfe534d42, 0x517b,     0x5346414f, 0x00c36400,
    0x01021997, 0x7461636f, 0x01161970, 0x0bd00bd0, 0x47504653, 0x19830326,
};

constexpr std::uintmax_t kReserve = std::uintmax_t{256} << 20U;

}  // namespace

void require_room(const std::filesystem::path& directory, std::int64_t bytes) {
    std::error_code error;
    const std::filesystem::space_info disk = std::filesystem::space(directory, error);
    if (error) {
        throw StoreError("store: " + directory.string() + ": " + error.message());
    }
    const auto reserve = std::min(kReserve, disk.capacity / 20);
    if (disk.available < reserve || disk.available - reserve < static_cast<std::uintmax_t>(bytes)) {
        throw StoreError("store: the disk is nearly full", StoreError::Kind::Full);
    }
}

bool is_network_file_system(unsigned long type) {
    return std::find(kNetworkFileSystems.begin(), kNetworkFileSystems.end(), type & 0xffffffffUL) !=
           kNetworkFileSystems.end();
}

void prepare_data_dir(const std::filesystem::path& path) {
    // SQLite makes its files with the process's mask: nobody else may read patient data.
    ::umask(0077);
    std::error_code error;
    std::filesystem::create_directories(path, error);
    struct statfs file_system {};
    if (error || ::statfs(path.c_str(), &file_system) != 0) {
        throw StoreError("data directory " + path.string() +
                         " can't be made: " + (error ? error.message() : std::strerror(errno)));
    }
    if (is_network_file_system(static_cast<unsigned long>(file_system.f_type))) {
        throw StoreError("data directory " + path.string() +
                         " is on a network file system; it must be on a local disk");
    }
}

DataDir::DataDir(std::filesystem::path path) : path_(std::move(path)) {
    prepare_data_dir(path_);
    const auto lock_file = path_ / "lock";
    lock_ = ::open(lock_file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (lock_ < 0) {
        throw StoreError("data directory " + path_.string() +
                         " can't be written: " + std::strerror(errno));
    }
    if (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
        ::close(lock_);
        throw StoreError("data directory " + path_.string() + " is in use by another server");
    }
}

DataDir::~DataDir() {
    ::close(lock_);
}

}  // namespace remesh
