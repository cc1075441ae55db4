// Watches of jobs that take much to tell: what is made of a job is shared by all who watch it.

#include "server/watch_news.h"

#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <list>
#include <memory>
#include <string>
#include <vector>

#include "server/store/sqlite_job_store.h"
#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::CallContext;
using testing::ScriptedEngine;
using testing::TemporaryDirectory;
using testing::TestServer;

const ScriptedEngine kCopy;

v1::JobEvent read(const WatchMessage& message) {
    grpc::ByteBuffer bytes(message.bytes);
    v1::JobEvent event;
    EXPECT_TRUE(grpc::SerializationTraits<v1::JobEvent>::Deserialize(&bytes, &event).ok());
    return event;
}

/// Where a message's first bytes lie: two that share them were written once.
const void* place_of(const WatchMessage& message) {
    std::vector<grpc::Slice> parts;
    message.bytes.Dump(&parts);
    return parts.front().begin();
}

/// A job in a store, and what its watchers are told.
class News : public ::testing::Test {
protected:
    News() {
        v1::JobSpec spec;
        spec.mutable_input()->mutable_digest()->set_sha256(std::string(64, '0'));
        spec.add_outputs()->set_format(v1::FORMAT_STL);
        for (const char* label : {"one", "two", "three", "four"}) {
            (*spec.mutable_labels())[label] = std::string(250, 'x');
        }
        store->create({key, "", canonical_spec(spec)}, {}, system_now());
    }
    StoredEvent event(std::int64_t sequence) {
        return store->events_after(key, sequence - 1, 1).at(0);
    }

    TemporaryDirectory directory;
    const JobKey key{"clinic", "j"};
    const std::unique_ptr<JobStore> store = open_sqlite_store(directory.path() / "store.sqlite");
    ArtifactStore artifacts{directory.path(), *store};
    const ProtoCodec codec;
    JobRegistry registry{*store, artifacts, codec, kCopy, {}};
    TenantSlots bytes{"bytes", 1'000'000, 5'000};
    WatchNews news{registry, bytes, std::chrono::hours(1)};
};

TEST_F(News, AreReadOnceUntilTheJobChanges) {
    EXPECT_EQ(news.view(key).job.state, JobState::Queued);
    const WatchMessage first = news.snapshot(key);
    store->request_cancel(key, system_now());

    EXPECT_EQ(news.view(key).job.state, JobState::Queued) << "nobody has said that it changed";
    EXPECT_EQ(place_of(news.snapshot(key)), place_of(first));
    news.expire(key);
    EXPECT_EQ(news.view(key).job.state, JobState::Cancelled);
    EXPECT_EQ(read(news.snapshot(key)).snapshot().state(), v1::Job::STATE_CANCELLED);
    EXPECT_EQ(read(first).snapshot().state(), v1::Job::STATE_QUEUED);
}

TEST_F(News, TellAChangeToAllInTheSameBytes) {
    store->request_cancel(key, system_now());

    const WatchMessage first = news.message(key, event(2), 0);
    const WatchMessage second = news.message(key, event(2), 7);

    EXPECT_EQ(place_of(first), place_of(second));
    EXPECT_EQ(read(first).completed().state(), v1::Job::STATE_CANCELLED);
    EXPECT_EQ(read(first).sequence(), 2);
    EXPECT_EQ(read(first).skipped_events(), 0);
    v1::JobEvent rest = read(second);
    EXPECT_EQ(rest.skipped_events(), 7) << "each is told what it missed";
    rest.clear_skipped_events();
    EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(rest, read(first)));
}

TEST_F(News, TellAnEventAsItWasWrittenDown) {
    const auto claimed = store->claim({"worker", {}}, system_now());
    v1::JobEvent said;
    said.mutable_warning()->set_code("CODE");
    const Time time = system_now();
    store->append({key, claimed->epoch},
                  std::vector{NewEvent{EventKind::Warning, time, said.SerializeAsString()}}, {},
                  time);

    const v1::JobEvent told = read(news.message(key, event(3), 5));

    EXPECT_EQ(told.warning().code(), "CODE");
    EXPECT_EQ(told.sequence(), 3);
    EXPECT_EQ(told.skipped_events(), 5);
    EXPECT_EQ(told.time().SerializeAsString(), to_proto(time).SerializeAsString());
}

TEST_F(News, KnowTheEndOfAJobThatEndedSinceItWasRead) {
    ASSERT_EQ(news.view(key).job.last_sequence, 1);
    const auto claimed = store->claim({"worker", {}}, system_now());
    JobFailure failure;
    failure.reason = "UNMESHABLE";
    store->settle({key, claimed->epoch},
                  {.state = JobState::Failed, .outcome = codec.encode_failure(failure)},
                  system_now());

    EXPECT_EQ(read(news.message(key, event(3), 0)).completed().failure().reason(), "UNMESHABLE");
}

TEST_F(News, TakeRoomUntilTheyAreSent) {
    std::list<WatchMessage> unsent;
    for (int i = 0; i < 100; ++i) {
        unsent.push_back(news.snapshot(key));
    }
    EXPECT_LT(bytes.taken(), 2'000) << "those are one";

    EXPECT_THROW(
        while (true) {
            news.expire(key);
            unsent.push_back(news.snapshot(key));
        },
        StatusError);
    EXPECT_GE(bytes.taken(), 5'000);
    unsent.clear();
    news.forget(key);
    EXPECT_EQ(bytes.taken(), 0);
}

TEST_F(News, EndWithTheJob) {
    store->request_cancel(key, system_now());
    ASSERT_TRUE(is_terminal(news.view(key).job.state));
    std::vector<std::string> freed;
    store->remove(key, {}, &freed);

    news.expire(key);

    EXPECT_THROW(news.view(key), JobError);
    EXPECT_THROW(news.view(key), JobError) << "what is gone isn't remembered";
}

/// A watch that somebody opened and doesn't read: little of a message may be on its way.
class HeldWatch {
public:
    HeldWatch(TestServer& server, const std::string& name) : context_(server.token) {
        grpc::ChannelArguments arguments;
        arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
        arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
        jobs_ = v1::JobService::NewStub(grpc::CreateCustomChannel(
            server.address(), grpc::InsecureChannelCredentials(), arguments));
        v1::WatchJobRequest request;
        request.set_name(name);
        request.set_after_sequence(1'000);  // It needs to be told of none.
        stream_ = jobs_->WatchJob(&context_, request);
        stream_->WaitForInitialMetadata();
    }
    /// Reads on to the end.
    grpc::Status finish() {
        v1::JobEvent event;
        while (stream_->Read(&event)) {
        }
        return stream_->Finish();
    }

private:
    CallContext context_;
    std::unique_ptr<v1::JobService::Stub> jobs_;
    std::unique_ptr<grpc::ClientReader<v1::JobEvent>> stream_;
};

/// Makes a job of a tenant that takes 800 kB to tell, and waits for its end.
std::string done_job_of(TestServer& server, const std::string& tenant) {
    server.token = server.token_for(tenant);
    v1::CreateJobRequest request = server.request_for("mesh");
    auto* region = request.mutable_spec()->mutable_options()->mutable_sizing()->add_regions();
    region->set_size(1.0);
    region->mutable_points()->mutable_coordinates()->Resize(99'999, 1.0);
    request.mutable_spec()->set_skip_cache(true);
    v1::Job job;
    EXPECT_TRUE(server.create(request, &job).ok());
    while (job.state() != v1::Job::STATE_SUCCEEDED) {
        EXPECT_TRUE(server.get(job.name(), &job).ok());
    }
    return job.name();
}

TEST(WatchTest, CountsOnceWhatWatchesLeaveUnreadOfTheSameJob) {
    TestServer server(
        kCopy, [](ServerOptions& options) { options.watches.max_bytes_of_tenant = 12'000'000; });
    const std::string job = done_job_of(server, "default");
    server.token.clear();

    std::list<HeldWatch> watches;
    for (int i = 0; i < 50; ++i) {
        watches.emplace_back(server, job);  // 40 MB, if they were counted each; again each second
    }

    EXPECT_TRUE(HeldWatch(server, job).finish().ok());
}

TEST(WatchTest, LimitsWhatATenantLeavesUnreadOfItsJobs) {
    TestServer server(kCopy, [](ServerOptions& options) {
        options.requires_credentials = true;
        options.watches.max_bytes_of_tenant = 1'000'000;
    });
    const std::string of_lab = done_job_of(server, "lab");
    const std::string first = done_job_of(server, "clinic");
    const std::string second = done_job_of(server, "clinic");
    const std::string third = done_job_of(server, "clinic");

    std::list<HeldWatch> watches;
    watches.emplace_back(server, first);
    watches.emplace_back(server, second);
    EXPECT_EQ(HeldWatch(server, third).finish().error_message(),
              "a tenant has at most 1000000 bytes of watches at a time");
    server.token = server.token_for("lab");
    EXPECT_TRUE(HeldWatch(server, of_lab).finish().ok()) << "it has its own";
}

TEST(WatchTest, RefusesAnEnormousRequest) {
    TestServer server(kCopy);
    const std::string enormous(100'000, 'x');

    const grpc::Status of_job = HeldWatch(server, enormous).finish();
    CallContext context(server.token);
    v1::WatchQueueRequest request;
    request.set_parent(enormous);
    const auto stream = server.jobs->WatchQueue(&context, request);
    v1::QueueEvent event;
    EXPECT_FALSE(stream->Read(&event));
    const grpc::Status of_queue = stream->Finish();

    for (const grpc::Status& status : {of_job, of_queue}) {
        EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
        EXPECT_EQ(status.error_message().find("request must take at most 65536 bytes"), 0U)
            << status.error_message();
    }
}

}  // namespace
}  // namespace remesh
