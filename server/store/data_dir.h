#pragma once

#include <filesystem>

namespace remesh {

/// The right to use a data directory alone, as long as this object lives.
class DataDir {
public:
    /// Makes the directory (mode 0700) if it isn't there, and takes it.
    ///
    /// \throws StoreError if another server has it, or if it lies on a network file system, where
    /// neither locks nor syncs can be trusted
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
