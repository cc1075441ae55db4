#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "server/healthcheck.h"
#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::CallContext;
using testing::Gate;
using testing::ScriptedEngine;
using ::testing::SizeIs;
using testing::TestServer;

const ScriptedEngine kCopy;

ScriptedEngine::Script relaxing_until(Gate& gate) {
    return [&gate](const JobRequest& request, const JobFiles& input, RunContext& run,
                   OutputSink& outputs) {
        run.enter(Stage::Relax);
        for (int i = 0; i < 10; ++i) {
            run.sample({.quality = QualitySample{}});
        }
        gate.pass(run);
        run.enter(Stage::Improve);
        return ScriptedEngine::copy_input(request, input, run, outputs);
    };
}

std::vector<std::int64_t> sequences_of(const std::vector<v1::JobEvent>& events) {
    std::vector<std::int64_t> sequences;
    for (const v1::JobEvent& event : events) {
        sequences.push_back(event.sequence());
    }
    return sequences;
}

TEST(Service, RunsAJobFromUploadToDownload) {
    TestServer server(kCopy);

    const v1::Job created = server.create("mesh");
    const auto events = server.watch(created.name());
    const v1::Job job = events.back().completed();
    std::string bytes;
    const auto status = server.download(job.result().outputs(0).digest().sha256(), 0, 0, &bytes);

    EXPECT_EQ(created.state(), v1::Job::STATE_QUEUED);
    EXPECT_EQ(job.state(), v1::Job::STATE_SUCCEEDED);
    EXPECT_EQ(job.spec().input().file_name(), "input.stl");
    EXPECT_EQ(job.result().provenance().input().sha256(), sha256_of("mesh"));
    EXPECT_EQ(job.progress().fraction(), 1.0);
    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(bytes, "out:mesh");
}

TEST(Service, WatchesFromTheSequenceThatAClientSawLast) {
    Gate gate;
    const ScriptedEngine engine(relaxing_until(gate));
    TestServer server(engine);
    const std::string name = server.create("mesh").name();

    const auto first = server.watch(
        name, 0, nullptr, [](const v1::JobEvent& event) { return event.sequence() == 6; });
    gate.open();
    const auto second = server.watch(name, 6);
    const auto all = server.watch(name, 0);

    ASSERT_GE(first.size(), 7U);
    EXPECT_EQ(first.front().sequence(), 0);
    EXPECT_TRUE(first.front().has_snapshot());
    auto joined = sequences_of(first);
    joined.resize(7);
    const auto rest = sequences_of(second);
    joined.insert(joined.end(), rest.begin() + 1, rest.end());
    EXPECT_EQ(joined, sequences_of(all));
    for (std::size_t i = 0; i < joined.size(); ++i) {
        EXPECT_EQ(joined[i], static_cast<std::int64_t>(i));
    }
    EXPECT_TRUE(all.back().has_completed());
}

TEST(Service, TellsTheEndAgainToAClientThatHadSeenIt) {
    TestServer server(kCopy);
    const std::string name = server.create("mesh").name();
    const auto all = server.watch(name);
    grpc::Status status;

    const auto again = server.watch(name, all.back().sequence(), &status);

    EXPECT_TRUE(status.ok());
    ASSERT_THAT(again, SizeIs(2));
    EXPECT_EQ(again.back().sequence(), all.back().sequence());
    EXPECT_TRUE(again.back().has_completed());
}

TEST(Service, CancelsARunningJobAndEndsItsWatch) {
    Gate gate;
    const ScriptedEngine engine(relaxing_until(gate));
    TestServer server(engine);
    const std::string name = server.create("mesh").name();
    server.wait_for(name, v1::Job::STATE_RUNNING);

    v1::Job cancelling;
    server.cancel(name, &cancelling);
    const auto events = server.watch(name);

    EXPECT_THAT(cancelling.state(),
                ::testing::AnyOf(v1::Job::STATE_CANCELLING, v1::Job::STATE_CANCELLED));
    EXPECT_EQ(events.back().completed().state(), v1::Job::STATE_CANCELLED);
    EXPECT_FALSE(events.back().completed().has_failure());
}

TEST(Service, OnlyChecksWhenAskedTo) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = server.request_for("mesh");
    request.set_validate_only(true);
    v1::Job job;

    const grpc::Status status = server.create(request, &job);

    CallContext context;
    v1::ListJobsResponse list;
    server.jobs->ListJobs(&context, {}, &list);
    EXPECT_TRUE(status.ok());
    EXPECT_EQ(job.name(), "");
    EXPECT_EQ(job.estimate().tets(), 4);
    EXPECT_EQ(job.estimate().memory_bytes(), 1 << 20);
    EXPECT_EQ(job.estimate().cpu_time().seconds(), 1);
    EXPECT_EQ(job.estimate().cpu_time().nanos(), 500'000'000);
    EXPECT_EQ(list.jobs_size(), 0);
}

TEST(Service, AnswersAnEqualJobByTheResultUnlessToldNotTo) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = server.request_for("mesh");
    v1::Job first;
    server.create(request, &first);
    const v1::Job done = server.watch(first.name()).back().completed();
    request.mutable_spec()->set_priority(5);
    (*request.mutable_spec()->mutable_labels())["other"] = "label";
    v1::Job again;
    v1::Job anew;
    v1::Job other;

    server.create(request, &again);
    request.mutable_spec()->set_skip_cache(true);
    server.create(request, &anew);
    request.mutable_spec()->set_skip_cache(false);
    request.mutable_spec()->mutable_options()->set_seed(2);
    server.create(request, &other);

    EXPECT_EQ(again.state(), v1::Job::STATE_SUCCEEDED);
    EXPECT_EQ(again.origin(), first.name());
    EXPECT_EQ(again.attempt(), 0);
    EXPECT_EQ(again.spec().priority(), 5);
    EXPECT_EQ(again.result().SerializeAsString(), done.result().SerializeAsString());
    EXPECT_TRUE(server.watch(again.name()).back().has_completed());
    EXPECT_EQ(anew.state(), v1::Job::STATE_QUEUED);
    EXPECT_EQ(other.state(), v1::Job::STATE_QUEUED);
}

TEST(Service, RunsAJobAgainWhoseEqualsResultIsKnownToBeDamaged) {
    TestServer server(kCopy);
    const v1::CreateJobRequest request = server.request_for("mesh");
    const auto run = [&] {
        v1::Job job;
        server.create(request, &job);
        return server.watch(job.name()).back().completed();
    };
    const v1::Job first = run();
    const auto digest = first.result().outputs(0).digest().sha256();
    const auto file = server.data_dir() / "tenants/default/artifacts" / digest;
    std::string whole;
    ASSERT_TRUE(server.download(digest, 0, 0, &whole).ok());
    ASSERT_EQ(run().origin(), first.name());

    const auto lose = [&] { std::filesystem::remove(file); };
    const auto cut = [&] { std::filesystem::resize_file(file, whole.size() - 1); };
    const auto rot = [&] {
        std::ofstream(file) << std::string(whole.size(), 'x');
        std::string bytes;
        EXPECT_EQ(server.download(digest, 0, 0, &bytes).error_code(), grpc::StatusCode::DATA_LOSS);
    };
    for (const std::function<void()>& damage : {std::function<void()>(lose), {cut}, {rot}}) {
        damage();
        const v1::Job anew = run();
        EXPECT_EQ(anew.attempt(), 1);
        EXPECT_EQ(anew.origin(), "");
        std::string bytes;
        EXPECT_TRUE(server.download(digest, 0, 0, &bytes).ok());
        EXPECT_EQ(bytes, whole);
        EXPECT_EQ(run().origin(), anew.name());
    }
}

TEST(Service, TriesAFailedJobAgainAsANewOne) {
    std::atomic<bool> is_broken = true;
    const ScriptedEngine engine(
        [&](const JobRequest& request, const JobFiles& input, RunContext& run, OutputSink& out) {
            if (is_broken) {
                throw Error(ErrorCode::Unmeshable, "no body");
            }
            return ScriptedEngine::copy_input(request, input, run, out);
        });
    TestServer server(engine);
    const std::string failed = server.create("mesh").name();
    server.watch(failed);
    is_broken = false;
    v1::RetryJobRequest request;
    request.set_name(failed);
    CallContext context;
    CallContext second_context;
    v1::Job again;
    v1::Job refused;

    const grpc::Status status = server.jobs->RetryJob(&context, request, &again);
    server.watch(again.name());
    request.set_name(again.name());
    const grpc::Status refusal = server.jobs->RetryJob(&second_context, request, &refused);

    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(again.origin(), failed);
    server.get(again.name(), &again);
    EXPECT_EQ(again.state(), v1::Job::STATE_SUCCEEDED);
    EXPECT_EQ(refusal.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
}

TEST(Service, CreatesOneJobForARepeatedRequestId) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = server.request_for("mesh");
    request.set_request_id("r");
    (*request.mutable_spec()->mutable_labels())["b"] = "2";
    (*request.mutable_spec()->mutable_labels())["a"] = "1";
    v1::Job first;
    v1::Job again;
    v1::Job other;

    server.create(request, &first);
    server.create(request, &again);
    request.mutable_spec()->set_priority(1);
    const grpc::Status conflict = server.create(request, &other);

    EXPECT_FALSE(first.name().empty());
    EXPECT_EQ(first.name(), again.name());
    EXPECT_EQ(conflict.error_code(), grpc::StatusCode::ALREADY_EXISTS);
}

TEST(Service, ShowsTheFailureOfAJobWhoseFileIsBad) {
    const ScriptedEngine engine(
        [](const JobRequest&, const JobFiles&, RunContext&, OutputSink&) -> JobResult {
            throw Error(ErrorCode::InvalidInput, "STL says 4,000,000 triangles but holds 498");
        });
    TestServer server(engine);

    const auto events = server.watch(server.create("mesh").name());

    const v1::Job& job = events.back().completed();
    EXPECT_EQ(job.state(), v1::Job::STATE_FAILED);
    EXPECT_EQ(job.failure().reason(), "INVALID_INPUT");
    EXPECT_EQ(job.failure().message(), "STL says 4,000,000 triangles but holds 498");
    EXPECT_EQ(job.failure().stage(), v1::STAGE_READ);
    EXPECT_FALSE(job.failure().retryable());
}

TEST(Service, GoesOnWithQueuedRunningAndFinishedJobsAfterARestart) {
    Gate gate;
    const ScriptedEngine engine(
        [&](const JobRequest& request, const JobFiles& input, RunContext& run, OutputSink& out) {
            if (input.surface != "finished") {
                gate.pass(run);
            }
            return ScriptedEngine::copy_input(request, input, run, out);
        });
    TestServer server(engine);
    const std::string finished = server.create("finished").name();
    const auto before = server.watch(finished);
    const std::string running = server.create("running").name();
    server.wait_for(running, v1::Job::STATE_RUNNING);
    const std::string queued = server.create("queued").name();

    server.stop();
    server.start();
    gate.open();

    const auto after = server.watch(finished);
    EXPECT_EQ(sequences_of(before), sequences_of(after));
    EXPECT_EQ(server.watch(running).back().completed().state(), v1::Job::STATE_SUCCEEDED);
    EXPECT_EQ(server.watch(running).back().completed().attempt(), 1);
    EXPECT_EQ(server.watch(queued).back().completed().state(), v1::Job::STATE_SUCCEEDED);
    std::string bytes;
    server.download(after.back().completed().result().outputs(0).digest().sha256(), 0, 0, &bytes);
    EXPECT_EQ(bytes, "out:finished");
}

TEST(Service, DeletesTerminalJobsAlone) {
    Gate gate;
    const ScriptedEngine engine(relaxing_until(gate));
    TestServer server(engine);
    const std::string name = server.create("mesh").name();
    server.wait_for(name, v1::Job::STATE_RUNNING);

    const grpc::Status running = server.remove(name);
    gate.open();
    const v1::Job job = server.watch(name).back().completed();
    const grpc::Status changed = server.remove(name, "1");
    const grpc::Status removed = server.remove(name, job.etag());
    v1::Job gone;
    std::string bytes;

    EXPECT_EQ(running.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    EXPECT_EQ(changed.error_code(), grpc::StatusCode::ABORTED);
    EXPECT_TRUE(removed.ok()) << removed.error_message();
    EXPECT_EQ(server.get(name, &gone).error_code(), grpc::StatusCode::NOT_FOUND);
    EXPECT_EQ(server.download(job.result().outputs(0).digest().sha256(), 0, 0, &bytes).error_code(),
              grpc::StatusCode::NOT_FOUND);
}

TEST(Service, MovesArtifactsInChunksAndRanges) {
    TestServer server(kCopy);
    std::string bytes(3'000'000, '\0');
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        bytes[i] = static_cast<char>(i * 7 + i / 251);
    }
    const v1::Digest digest = server.upload(bytes);
    v1::UploadArtifactResponse again;
    server.upload(bytes, digest, &again);

    std::string all;
    std::string range;
    EXPECT_TRUE(server.download(digest.sha256(), 0, 0, &all).ok());
    EXPECT_TRUE(server.download(digest.sha256(), 1'000'001, 1'500'000, &range).ok());
    EXPECT_EQ(all, bytes);
    EXPECT_EQ(range, bytes.substr(1'000'001, 1'500'000));
    EXPECT_TRUE(again.already_present());
    EXPECT_EQ(server.download(digest.sha256(), 3'000'001, 0, &all).error_code(),
              grpc::StatusCode::OUT_OF_RANGE);
}

TEST(Service, KeepsTheLifeOfAWatchGoingByHeartbeats) {
    Gate gate;
    const ScriptedEngine engine(relaxing_until(gate));
    TestServer server(engine, [](ServerOptions& options) {
        options.watches.heartbeat = std::chrono::milliseconds(20);
    });
    const std::string name = server.create("mesh").name();

    const auto events = server.watch(
        name, 0, nullptr, [](const v1::JobEvent& event) { return event.has_heartbeat(); });

    EXPECT_TRUE(std::any_of(events.begin(), events.end(),
                            [](const auto& event) { return event.has_heartbeat(); }));
    gate.open();
}

TEST(Service, EndsWatchesRetryablyWhenItShutsDown) {
    Gate gate;
    const ScriptedEngine engine(relaxing_until(gate));
    TestServer server(engine);
    const std::string name = server.create("mesh").name();
    std::jthread stopper;
    grpc::Status status;

    server.watch(name, 0, &status, [&](const v1::JobEvent& event) {
        if (event.sequence() == 3) {
            stopper = std::jthread([&] { server.stop(); });
        }
        return false;
    });

    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(Service, TellsWhatItCanDo) {
    TestServer server(kCopy);
    CallContext context;
    v1::GetCapabilitiesResponse capabilities;

    ASSERT_TRUE(server.capabilities->GetCapabilities(&context, {}, &capabilities).ok());

    EXPECT_EQ(capabilities.formats_size(), 11);
    EXPECT_EQ(capabilities.default_options().relaxation().damping(), RelaxOptions{}.damping);
    EXPECT_FALSE(capabilities.default_options().has_edge_length());
    EXPECT_EQ(capabilities.max_chunk_bytes(), 1 << 20);
}

TEST(Service, AnswersHealthChecksWhileItServes) {
    TestServer server(kCopy);
    const std::string address = server.address();

    EXPECT_TRUE(is_serving(address));
    server.stop();
    EXPECT_FALSE(is_serving(address));
}

}  // namespace
}  // namespace remesh
