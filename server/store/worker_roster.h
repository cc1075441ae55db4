#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace remesh {

/// Which worker processes of this machine live: each holds a lock on a file of its own in
/// `DATA/workers`, which the kernel takes from it when it dies, however it dies.
class WorkerRoster {
public:
    /// \throws StoreError if the directory can't be made
    explicit WorkerRoster(const std::filesystem::path& data_dir);

    [[nodiscard]] bool is_alive(const std::string& worker) const;
    /// Workers that live.
    [[nodiscard]] std::vector<std::string> alive() const;
    /// Deletes the files of the dead.
    void tidy() const;

private:
    friend class WorkerEntry;
    std::filesystem::path directory_;
};

/// A process's own entry in the roster, as long as this object lives.
class WorkerEntry {
public:
    WorkerEntry(const WorkerRoster& roster, std::string worker);
    WorkerEntry(const WorkerEntry&) = delete;
    WorkerEntry& operator=(const WorkerEntry&) = delete;
    ~WorkerEntry();

    [[nodiscard]] const std::string& worker() const { return worker_; }

private:
    std::string worker_;
    std::filesystem::path file_;
    int lock_ = -1;
};

}  // namespace remesh
