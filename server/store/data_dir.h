#pragma once

#include <cstdint>
#include <filesystem>

namespace remesh {

/// Makes a data directory (mode 0700) if it isn't there, and lets this process make files that are
/// the owner's alone.
///
/// \throws StoreError if it can't be made or lies on a network file system, where neither locks nor
/// syncs can be trusted
void prepare_data_dir(const std::filesystem::path& path);

/// Keeps 256 MiB of a directory's disk, or a twentieth of it, for the database and the results of
/// what runs.
/// \throws StoreError{Full} if `bytes` more would leave less
void require_room(const std::filesystem::path& directory, std::int64_t bytes);

/// Whether a file system of this type (statfs's f_type) is on another machine.
[[nodiscard]] bool is_network_file_system(unsigned long type);

/// The right to be a data directory's only server, as long as this object lives. Workers don't need
/// it.
class DataDir {
public:
    /// Prepares the directory and takes it.
    /// \throws StoreError if another server has it, or like prepare_data_dir
    explicit DataDir(std::filesystem::path path);
    DataDir(const DataDir&) = delete;
    DataDir& operator=(const DataDir&) = delete;
    ~DataDir();

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
    int lock_ = -1;
};

}  // namespace remesh
