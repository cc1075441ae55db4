// WatchQueue: a dashboard's view of its tenant's jobs; and watches whose reader is slow.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/jobs/process_memory.h"
#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::behind;
using testing::CallContext;
using testing::Gate;
using testing::ScriptedEngine;
using testing::TestServer;

const ScriptedEngine kCopy;

class QueueWatch {
public:
    explicit QueueWatch(TestServer& server) : stream_(server.jobs->WatchQueue(&context_, {})) {}

    /// The next event that isn't a heartbeat.
    v1::QueueEvent next() {
        v1::QueueEvent event;
        while (stream_->Read(&event) && event.has_heartbeat()) {
        }
        return event;
    }
    /// Reads until a job is in that state. \return the names that were seen
    void wait_for(const std::string& name, v1::Job::State state) {
        v1::QueueEvent event;
        while (stream_->Read(&event)) {
            if (event.job().name() == name && event.job().state() == state) {
                return;
            }
        }
        ADD_FAILURE() << "the stream ended";
    }
    grpc::Status finish() {
        context_.TryCancel();
        v1::QueueEvent event;
        while (stream_->Read(&event)) {
        }
        return stream_->Finish();
    }

private:
    CallContext context_;
    std::unique_ptr<grpc::ClientReader<v1::QueueEvent>> stream_;
};

TEST(QueueWatchTest, OpensWithTheJobsThatArentDone) {
    Gate gate;
    const ScriptedEngine engine(behind(gate));
    TestServer server(engine);
    const std::string first = server.create("one").name();
    server.wait_for(first, v1::Job::STATE_RUNNING);
    const std::string second = server.create("two").name();

    QueueWatch watch(server);
    const v1::QueueEvent newest = watch.next();
    const v1::QueueEvent oldest = watch.next();

    EXPECT_EQ(newest.job().name(), second);
    EXPECT_EQ(newest.job().state(), v1::Job::STATE_QUEUED);
    EXPECT_FALSE(newest.job().spec().has_options());
    EXPECT_EQ(oldest.job().name(), first);
    EXPECT_EQ(oldest.job().state(), v1::Job::STATE_RUNNING);
    EXPECT_TRUE(watch.next().has_opened());
    watch.finish();
    gate.open();
}

TEST(QueueWatchTest, KeepsNoSpecsForReadersThatDontRead) {
    constexpr int kJobs = 30;
    constexpr int kReaders = 20;
    constexpr int kCoordinates = 150'000;
    constexpr std::int64_t kSpecs = std::int64_t{kJobs} * kReaders * kCoordinates * sizeof(double);
    Gate gate;
    const ScriptedEngine engine(behind(gate));
    TestServer server(engine);
    v1::CreateJobRequest request = server.request_for("mesh");
    auto* regions = request.mutable_spec()->mutable_options()->mutable_sizing()->mutable_regions();
    regions->Add()->mutable_points()->mutable_coordinates()->Resize(kCoordinates, 1.0);
    // More of them than a stream takes that nobody reads.
    for (int i = 0; i < 16; ++i) {
        (*request.mutable_spec()->mutable_labels())["key-" + std::to_string(i)] =
            std::string(250, 'x');
    }
    v1::Job job;
    for (int i = 0; i < kJobs; ++i) {
        ASSERT_TRUE(server.create(request, &job).ok());
    }

    const std::int64_t before = resident_bytes();
    std::vector<std::unique_ptr<QueueWatch>> readers;
    for (int i = 0; i < kReaders; ++i) {
        readers.push_back(std::make_unique<QueueWatch>(server));
        EXPECT_TRUE(readers.back()->next().has_job());
    }

    EXPECT_LT(resident_bytes() - before, kSpecs / 4);
    for (const auto& reader : readers) {
        reader->finish();
    }
    gate.open();
}

TEST(QueueWatchTest, TellsOfJobsAsTheyChangeAndGo) {
    TestServer server(kCopy);
    QueueWatch watch(server);
    ASSERT_TRUE(watch.next().has_opened());

    const std::string name = server.create("mesh").name();
    watch.wait_for(name, v1::Job::STATE_SUCCEEDED);
    server.remove(name);

    v1::QueueEvent event;
    do {
        event = watch.next();
    } while (event.has_job());
    EXPECT_EQ(event.deleted(), name);
    watch.finish();
}

TEST(QueueWatchTest, SendsHeartbeatsWhileNothingHappens) {
    TestServer server(kCopy, [](ServerOptions& options) {
        options.watches.heartbeat = std::chrono::milliseconds(20);
    });
    CallContext context;
    const auto stream = server.jobs->WatchQueue(&context, {});
    v1::QueueEvent event;

    while (stream->Read(&event) && !event.has_heartbeat()) {
    }

    EXPECT_TRUE(event.has_heartbeat());
    context.TryCancel();
    stream->Finish();
}

TEST(QueueWatchTest, EndsRetryablyWhenTheServerShutsDown) {
    TestServer server(kCopy);
    CallContext context;
    const auto stream = server.jobs->WatchQueue(&context, {});
    v1::QueueEvent event;
    ASSERT_TRUE(stream->Read(&event));

    server.stop();
    while (stream->Read(&event)) {
    }

    EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(WatchTest, ThinsWhatASlowReaderMissedAndCountsIt) {
    Gate gate;
    const ScriptedEngine engine([&gate](const JobRequest& request, const JobFiles& input,
                                        RunContext& run, OutputSink& outputs) {
        run.enter(Stage::Relax);
        gate.pass(run);
        for (int i = 1; i <= 4'000; ++i) {
            run.sample({.quality = QualitySample{.mean = 1.0 / i}});
        }
        return ScriptedEngine::copy_input(request, input, run, outputs);
    });
    TestServer server(engine);
    const std::string name = server.create("mesh").name();
    server.wait_for(name, v1::Job::STATE_RUNNING);
    CallContext context;
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto stream = server.jobs->WatchJob(&context, request);
    v1::JobEvent event;
    ASSERT_TRUE(stream->Read(&event));

    // The reader reads nothing until the job is over.
    gate.open();
    server.watch(name);
    std::int64_t seen = 0;
    std::int64_t skipped = 0;
    std::int64_t last = 0;
    while (stream->Read(&event)) {
        EXPECT_GE(event.sequence(), last);
        last = std::max(last, event.sequence());
        seen += event.sequence() > 0 ? 1 : 0;
        skipped += event.skipped_events();
    }

    EXPECT_TRUE(stream->Finish().ok());
    EXPECT_TRUE(event.has_completed());
    EXPECT_EQ(seen + skipped, last);
    EXPECT_GT(skipped, 0);
}

}  // namespace
}  // namespace remesh
