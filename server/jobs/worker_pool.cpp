#include "server/jobs/worker_pool.h"

#include <spdlog/spdlog.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <exception>
#include <ostream>
#include <streambuf>
#include <utility>

#include "core/error.h"
#include "core/run_state.h"
#include "server/jobs/job_inputs.h"

namespace remesh {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

// Least time between two events of a kind; a new stage and a measured quality always pass.
constexpr std::chrono::milliseconds kProgressInterval{100};
constexpr std::chrono::milliseconds kSampleInterval{50};

class DraftBuffer final : public std::streambuf {
public:
    explicit DraftBuffer(ArtifactDraft& draft) : draft_(draft), buffer_(std::size_t{1} << 18U) {
        setp(buffer_.data(), buffer_.data() + buffer_.size());
    }

protected:
    int_type overflow(int_type c) override {
        sync();
        if (!traits_type::eq_int_type(c, traits_type::eof())) {
            sputc(traits_type::to_char_type(c));
        }
        return traits_type::not_eof(c);
    }
    int sync() override {
        draft_.write({pbase(), static_cast<std::size_t>(pptr() - pbase())});
        setp(buffer_.data(), buffer_.data() + buffer_.size());
        return 0;
    }

private:
    ArtifactDraft& draft_;
    std::vector<char> buffer_;
};

ArtifactDraft write_draft(ArtifactStore& artifacts, const std::string& tenant,
                          const OutputSink::Writer& write) {
    ArtifactDraft draft = artifacts.draft(tenant);
    DraftBuffer buffer(draft);
    std::ostream out(&buffer);
    out.exceptions(std::ios::badbit | std::ios::failbit);
    write(out);
    out.flush();
    return draft;
}

/// Keeps an attempt's files until it succeeds.
class DraftSink final : public OutputSink {
public:
    DraftSink(ArtifactStore& artifacts, std::string tenant)
        : artifacts_(artifacts), tenant_(std::move(tenant)) {}

    ArtifactId add(const Writer& write) override {
        drafts_.push_back(write_draft(artifacts_, tenant_, write));
        return drafts_.back().finish();
    }

    [[nodiscard]] std::vector<ArtifactDraft> take() { return std::move(drafts_); }

private:
    ArtifactStore& artifacts_;
    std::string tenant_;
    std::vector<ArtifactDraft> drafts_;
};

/// What a run tells, thinned out, on its way to the watchers.
class EventRelay {
public:
    EventRelay(Lease& lease, ArtifactStore& artifacts, const Engine& engine)
        : lease_(lease), artifacts_(artifacts), engine_(engine) {}

    void operator()(const RunEvent& event) {
        std::visit([this](const auto& body) { tell(body); }, event);
    }

private:
    void tell(const Progress& progress) {
        if (progress.stage != stage_ || is_due(last_progress_, kProgressInterval)) {
            stage_ = progress.stage;
            last_progress_ = std::chrono::steady_clock::now();
            lease_.publish(progress);
        }
    }
    void tell(const ConvergenceSample& sample) {
        if (sample.quality || is_due(last_sample_, kSampleInterval)) {
            last_sample_ = std::chrono::steady_clock::now();
            lease_.publish(sample);
        }
    }
    void tell(const Warning& warning) { lease_.publish(warning); }
    void tell(const Preview& preview) {
        lease_.publish_preview(
            write_draft(artifacts_, lease_.job().key.tenant,
                        [&](std::ostream& out) { engine_.write_preview(preview.surface, out); }),
            preview.iteration);
    }

    static bool is_due(SteadyTime last, std::chrono::milliseconds interval) {
        return std::chrono::steady_clock::now() - last >= interval;
    }

    Lease& lease_;
    ArtifactStore& artifacts_;
    const Engine& engine_;
    Stage stage_ = Stage::Read;
    SteadyTime last_progress_{};
    SteadyTime last_sample_{};
};

/// How an attempt ended, for the log.
struct Ending {
    Ending(std::optional<JobState> ended, const char* why)
        : state(ended ? state_name(*ended) : "void"),
          is_jobs_end(ended && is_terminal(*ended)),
          reason(why) {}

    std::string_view state;
    bool is_jobs_end;
    const char* reason;
};

/// Saves where a run stands, in the job's checkpoint.
RunState::Save saving(const ArtifactStore& artifacts, const JobKey& job, std::string key) {
    return [&artifacts, job, key = std::move(key)](const std::vector<std::string_view>& pieces) {
        try {
            artifacts.checkpoints().save(job, key, pieces);
        } catch (const StoreError& error) {
            // It costs time if this attempt is lost, nothing else.
            spdlog::error("event=checkpoint_failed job={} message=\"{}\"", job.id, error.what());
        }
    };
}

/// Makes a run go on where the last attempt was, if that can be told.
void resume(RunState& state, const ArtifactStore& artifacts, const JobKey& job,
            std::string_view key) {
    using Finding = CheckpointFiles::Finding;
    const CheckpointFiles::Loaded loaded = artifacts.checkpoints().load(job, key);
    switch (loaded.finding) {
        case Finding::None: break;
        case Finding::Good:
            state.resume(loaded.state);
            spdlog::info("event=job_resumed job={} bytes={}", job.id, loaded.state.size());
            break;
        case Finding::Stale:
            spdlog::warn("event=checkpoint_unusable job={} reason=stale", job.id);
            break;
        case Finding::Damaged:
            spdlog::warn("event=checkpoint_unusable job={} reason=damaged", job.id);
            break;
    }
}

/// What an attempt needs besides its lease.
struct Bench {
    ArtifactStore& artifacts;
    const JobCodec& codec;
    const Engine& engine;
    const WorkerOptions& options;
    tbb::task_arena& arena;
};

/// The one place where exceptions become an attempt's verdict.
Ending run_attempt(Lease& lease, const Bench& bench, bool resumes = true) {
    const auto& [artifacts, codec, engine, options, arena] = bench;
    const JobRecord& job = lease.job();
    const std::string key = codec.cache_key(job.spec);
    RunContext run(lease.stop_token(), EventRelay(lease, artifacts, engine));
    RunState state(saving(artifacts, job.key, key), options.checkpoint_interval);
    try {
        run.checkpoint();
        if (resumes) {
            resume(state, artifacts, job.key, key);
        }
        run.keep_state(state);
        const JobRequest request = codec.decode_spec(job.spec);
        const JobInputs inputs(artifacts, job.key.tenant, request);
        if (!inputs.missing().empty()) {
            throw StoreError("store: a job's input is gone");
        }
        inputs.verify(artifacts, run);
        DraftSink sink(artifacts, job.key.tenant);
        JobResult result;
        arena.execute([&] { result = bench.engine.run(request, inputs.files(), run, sink); });
        if (!result.broken_bounds.empty()) {
            return {lease.fail({"BOUND_NOT_MET", result.broken_bounds, false, Stage::Report,
                                result.outputs},
                               sink.take()),
                    "BOUND_NOT_MET"};
        }
        const auto ended = lease.succeed(result, sink.take());
        return {ended, ended == JobState::Cancelled ? "CANCELLED" : "OK"};
    } catch (const Error& error) {
        const char* reason = reason_of(error.code());
        if (error.code() == ErrorCode::Cancelled) {
            if (lease.is_giving_back()) {
                state.save();
            }
            return {lease.stopped(run.stage()), reason};
        }
        const bool is_retryable = error.code() == ErrorCode::Internal;
        return {lease.fail({reason, error.what(), is_retryable, run.stage()}), reason};
    } catch (const StaleState&) {
        spdlog::warn("event=checkpoint_unusable job={} reason=stale", job.key.id);
        return run_attempt(lease, bench, false);
    } catch (const StoreError& error) {
        spdlog::error("event=store_failed job={} message=\"{}\"", job.key.id, error.what());
        if (error.kind() == StoreError::Kind::Lost) {  // Waiting doesn't bring it back.
            return {lease.fail({"STORAGE",
                                "The stored bytes of an input no longer have their digest; upload "
                                "it again, then retry.",
                                true, run.stage()}),
                    "STORAGE"};
        }
        return {lease.postpone(), "STORE"};
    } catch (const std::bad_alloc&) {
        return {
            lease.fail({"TOO_LARGE", "There isn't enough memory for this job.", true, run.stage()}),
            "TOO_LARGE"};
    } catch (const std::exception&) {
        // What a library says may quote file names or data: it goes nowhere.
        return {lease.fail({"INTERNAL",
                            "The engine failed in stage " + std::string(stage_name(run.stage())) +
                                "; this is a defect.",
                            true, run.stage()}),
                "INTERNAL"};
    }
}

/// Goes on trying while the store is in trouble.
std::unique_ptr<Lease> claim(LeaseDesk& desk, const std::stop_token& stop) {
    while (true) {
        try {
            return desk.claim(stop);
        } catch (const StoreError& error) {
            spdlog::error("event=store_failed message=\"{}\"", error.what());
        }
        if (!desk.pause(stop)) {
            return nullptr;
        }
    }
}

void work(LeaseDesk& desk, ArtifactStore& artifacts, const JobCodec& codec, const Engine& engine,
          const WorkerOptions& options, const std::stop_token& stop) {
    tbb::task_arena arena(options.threads);
    const Bench bench{artifacts, codec, engine, options, arena};
    while (const auto lease = claim(desk, stop)) {
        const std::string& id = lease->job().key.id;
        const int attempt = lease->job().attempt;
        const auto start = std::chrono::steady_clock::now();
        spdlog::info("event=job_started job={} attempt={}", id, attempt);
        Ending ending{std::nullopt, "STORE"};
        try {
            ending = run_attempt(*lease, bench);
        } catch (const std::exception& error) {
            spdlog::error("event=store_failed job={} attempt={} message=\"{}\"", id, attempt,
                          error.what());
        }
        if (ending.is_jobs_end) {
            artifacts.checkpoints().remove(lease->job().key);
        }
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        spdlog::info("event=job_ended job={} attempt={} state={} reason={} seconds={:.3f}", id,
                     attempt, ending.state, ending.reason, seconds.count());
    }
}

}  // namespace

WorkerPool::WorkerPool(LeaseDesk& desk, ArtifactStore& artifacts, const JobCodec& codec,
                       const Engine& engine, const WorkerOptions& options) {
    for (int i = 0; i < options.workers; ++i) {
        threads_.emplace_back([&, options](const std::stop_token& stop) {
            work(desk, artifacts, codec, engine, options, stop);
        });
    }
}

}  // namespace remesh
