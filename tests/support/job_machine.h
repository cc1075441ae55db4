#pragma once

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "server/jobs/housekeeper.h"
#include "server/jobs/lease_desk.h"
#include "server/jobs/registry.h"
#include "server/jobs/worker_pool.h"
#include "server/store/artifact_store.h"
#include "server/store/sqlite_job_store.h"
#include "server/store/worker_roster.h"
#include "tests/support/scripted_engine.h"
#include "tests/support/temporary_directory.h"

namespace remesh::testing {

/// Specs are "<sha256> <size> <priority>"; the rest is plain text.
class TextCodec final : public JobCodec {
public:
    static std::string spec(const ArtifactId& input, int priority) {
        return input.sha256 + " " + std::to_string(input.size) + " " + std::to_string(priority);
    }

    [[nodiscard]] JobRequest decode_spec(std::string_view spec) const override {
        const std::string text(spec);
        const auto second = text.find(' ', 65);
        JobRequest request;
        request.input = {text.substr(0, 64), std::stoll(text.substr(65, second - 65))};
        request.priority = std::stoi(text.substr(second + 1));
        return request;
    }
    [[nodiscard]] std::string cache_key(std::string_view) const override { return {}; }
    [[nodiscard]] Progress decode_progress(std::string_view) const override { return {}; }
    [[nodiscard]] std::string encode_event(const JobEventBody& event) const override {
        if (const auto* sample = std::get_if<ConvergenceSample>(&event)) {
            return "sample " + std::to_string(sample->iteration);
        }
        if (const auto* warning = std::get_if<Warning>(&event)) {
            return "warning " + warning->code;
        }
        if (const auto* preview = std::get_if<StoredPreview>(&event)) {
            return preview->artifact.sha256;
        }
        return "progress";
    }
    [[nodiscard]] std::string encode_result(std::string_view,
                                            const JobResult& result) const override {
        return "result of " + std::to_string(result.outputs.size());
    }
    [[nodiscard]] std::string encode_failure(const JobFailure& failure) const override {
        return failure.reason;
    }
};

/// What a call is refused with.
inline JobErrorCode code_of(const std::function<void()>& call) {
    try {
        call();
    } catch (const JobError& error) {
        return error.code();
    }
    throw std::logic_error("no JobError came");
}

/// A registry with workers and a housekeeper over a directory, without a network. `stop` and
/// `start` are what a restart of the server does.
class JobMachine {
public:
    explicit JobMachine(ScriptedEngine::Script script = ScriptedEngine::copy_input,
                        RegistryOptions options = {}, DeskOptions desk_options = {})
        : engine_(std::move(script)), options_(options), desk_options_(std::move(desk_options)) {
        desk_options_.worker = "machine";
        desk_options_.flush_interval = std::chrono::milliseconds(5);
        start();
    }
    ~JobMachine() { stop(); }

    void start() {
        store_ = open_sqlite_store(directory_.path() / "store.sqlite");
        artifacts_ = std::make_unique<ArtifactStore>(directory_.path(), *store_);
        registry_ = std::make_unique<JobRegistry>(*store_, *artifacts_, codec_, engine_, options_);
        housekeeper_ = std::make_unique<Housekeeper>(
            *store_, *artifacts_, *registry_, codec_,
            [this](const std::string& worker) { return roster_.is_alive(worker); },
            HousekeeperOptions{});
        housekeeper_->take_up(system_now());
        entry_ = std::make_unique<WorkerEntry>(roster_, "machine");
        desk_ = std::make_unique<LeaseDesk>(*store_, *artifacts_, codec_, desk_options_);
        registry_->set_listener([this](const JobKey&) {
            const std::scoped_lock lock(mutex_);
            ++changes_;
            changed_.notify_all();
        });
    }
    void start_workers(int count) {
        workers_ = std::make_unique<WorkerPool>(*desk_, *artifacts_, codec_, engine_,
                                                WorkerOptions{count, 1});
    }
    /// As SIGTERM does.
    void stop() {
        registry_->drain();
        desk_->drain();
        workers_.reset();
        desk_.reset();
        entry_.reset();
        housekeeper_.reset();
        registry_.reset();
        artifacts_.reset();
        store_.reset();
    }

    ArtifactId upload(const std::string& bytes) {
        ArtifactDraft draft = artifacts_->draft("clinic");
        draft.write(bytes);
        const ArtifactId artifact = draft.finish();
        artifacts_->add(std::move(draft), system_now());
        return artifact;
    }
    JobKey submit(const std::string& bytes, int priority = 0, const std::string& request_id = "") {
        return registry_
            ->submit({"clinic", request_id, TextCodec::spec(upload(bytes), priority), false})
            .job.key;
    }

    /// The job once it is in a state, or as it is after five minutes.
    JobRecord wait_for(const JobKey& key, JobState state) {
        return wait_until(key, [&](const JobRecord& job) { return job.state == state; });
    }
    JobRecord wait_until(const JobKey& key, const std::function<bool(const JobRecord&)>& is_met) {
        const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(5);
        while (true) {
            std::uint64_t seen = 0;
            {
                const std::scoped_lock lock(mutex_);
                seen = changes_;
            }
            JobRecord job = registry_->get(key).job;
            std::unique_lock lock(mutex_);
            if (is_met(job) ||
                !changed_.wait_until(lock, deadline, [&] { return changes_ != seen; })) {
                return job;
            }
        }
    }

    [[nodiscard]] const std::filesystem::path& directory() const { return directory_.path(); }
    JobStore& store() { return *store_; }
    ArtifactStore& artifacts() { return *artifacts_; }
    JobRegistry& registry() { return *registry_; }
    LeaseDesk& desk() { return *desk_; }
    Housekeeper& housekeeper() { return *housekeeper_; }

private:
    TemporaryDirectory directory_;
    TextCodec codec_;
    ScriptedEngine engine_;
    RegistryOptions options_;
    DeskOptions desk_options_;
    WorkerRoster roster_{directory_.path()};
    std::mutex mutex_;
    std::condition_variable changed_;
    std::uint64_t changes_ = 0;  // needs mutex_
    std::unique_ptr<JobStore> store_;
    std::unique_ptr<ArtifactStore> artifacts_;
    std::unique_ptr<JobRegistry> registry_;
    std::unique_ptr<Housekeeper> housekeeper_;
    std::unique_ptr<WorkerEntry> entry_;
    std::unique_ptr<LeaseDesk> desk_;
    std::unique_ptr<WorkerPool> workers_;
};

}  // namespace remesh::testing
