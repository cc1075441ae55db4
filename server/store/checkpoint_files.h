#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/job_record.h"

namespace remesh {

/// Where unfinished jobs stand, so that another attempt goes on from there: a file each, of mode
/// 0600, `tenants/TENANT/checkpoints/JOB`, replaced as a whole. Nothing depends on them but time.
/// All calls may come from any thread and process.
class CheckpointFiles {
public:
    explicit CheckpointFiles(std::filesystem::path data_dir);

    /// Replaces the job's checkpoint by the bytes in `pieces`.
    /// \param key  what the state belongs to: spec, input and engine, in one line
    /// \throws StoreError
    void save(const JobKey& job, std::string_view key,
              const std::vector<std::string_view>& pieces) const;

    /// What a checkpoint turned out to be.
    enum class Finding { None, Good, Stale, Damaged };
    struct Loaded {
        Finding finding = Finding::None;
        std::string state{};  ///< Of a Good one.
    };
    [[nodiscard]] Loaded load(const JobKey& job, std::string_view key) const;

    void remove(const JobKey& job) const;
    /// Deletes those of jobs that don't need one any more.
    void collect_garbage(const std::function<bool(const JobKey&)>& is_needed) const;

private:
    [[nodiscard]] std::filesystem::path directory_of(const std::string& tenant) const;

    std::filesystem::path data_dir_;
};

}  // namespace remesh
