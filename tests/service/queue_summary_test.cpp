#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "core/error.h"
#include "tests/support/test_server.h"

// The queue in numbers: what is counted, and who is told of whom.

namespace remesh {
namespace {

using testing::CallContext;
using ::testing::ElementsAre;
using ::testing::Property;
using testing::ScriptedEngine;
using testing::TestServer;

constexpr std::int64_t kTets = 1'234;

/// Makes the same number of tets of everything but "bad".
JobResult make_tets(const JobRequest& request, const JobFiles& files, RunContext& run,
                    OutputSink& outputs) {
    if (files.surface == "bad") {
        throw Error(ErrorCode::Unmeshable, "no");
    }
    JobResult result = ScriptedEngine::copy_input(request, files, run, outputs);
    result.report.tets.emplace().tets = kTets;
    return result;
}

v1::SummarizeQueueResponse summarize(TestServer& server, const std::string& token = {}) {
    CallContext context(token);
    v1::SummarizeQueueResponse reply;
    EXPECT_TRUE(server.queue->SummarizeQueue(&context, {}, &reply).ok());
    return reply;
}

template <typename List>
std::int64_t sum(const List& list) {
    return std::accumulate(list.begin(), list.end(), std::int64_t{0});
}

TEST(QueueSummary, OfAnEmptyServerIsTheCallersTenantAtZero) {
    const ScriptedEngine engine;
    TestServer server(engine);

    const auto summary = summarize(server);

    ASSERT_EQ(summary.tenants_size(), 1);
    EXPECT_EQ(summary.tenants(0).tenant(), "default");
    EXPECT_EQ(summary.tenants(0).succeeded_size(), 60);
    EXPECT_EQ(sum(summary.tenants(0).succeeded()), 0);
    EXPECT_FALSE(summary.tenants(0).has_oldest_queued_time());
    EXPECT_EQ(summary.interval().seconds(), 60);
    EXPECT_EQ(summary.start_time().seconds() % 60, 0);
}

TEST(QueueSummary, CountsWhatEndedAndTheTetsThatWereMade) {
    const ScriptedEngine engine(make_tets);
    TestServer server(engine);
    server.wait_for(server.create("one").name(), v1::Job::STATE_SUCCEEDED);
    server.wait_for(server.create("bad").name(), v1::Job::STATE_FAILED);
    server.wait_for(server.create("one").name(), v1::Job::STATE_SUCCEEDED);  // Answered at once.
    summarize(server);
    server.wait_for(server.create("two").name(), v1::Job::STATE_SUCCEEDED);
    server.stop();
    server.start();

    const v1::TenantSummary tenant = summarize(server).tenants(0);

    EXPECT_EQ(sum(tenant.succeeded()), 3);
    EXPECT_EQ(sum(tenant.failed()), 1);
    EXPECT_EQ(sum(tenant.cancelled()), 0);
    EXPECT_EQ(sum(tenant.tets()), 2 * kTets);
    EXPECT_EQ(sum(tenant.succeeded()), tenant.succeeded(58) + tenant.succeeded(59)) << "lately";
}

TEST(QueueSummary, ForgetsJobsThatAreDeleted) {
    const ScriptedEngine engine(make_tets);
    TestServer server(engine);
    const std::string job = server.create("one").name();
    server.wait_for(job, v1::Job::STATE_SUCCEEDED);
    ASSERT_EQ(sum(summarize(server).tenants(0).succeeded()), 1);

    ASSERT_TRUE(server.remove(job).ok());

    EXPECT_EQ(sum(summarize(server).tenants(0).succeeded()), 0);
}

TEST(QueueSummary, TellsTenantsOfThemselvesAndOperatorsOfAll) {
    testing::Gate gate;
    const ScriptedEngine engine(testing::behind(gate));
    TestServer server(engine, [](ServerOptions& options) { options.requires_credentials = true; });
    const std::string clinic = server.token = server.token_for("clinic");
    server.wait_for(server.create("runs").name(), v1::Job::STATE_RUNNING);
    const std::string surgery = server.token = server.token_for("surgery");
    const v1::Job waiting = server.create("waits");

    const auto own = summarize(server, clinic);
    const auto all = summarize(server, server.token_for("it", Role::Operator));

    ASSERT_EQ(own.tenants_size(), 1);
    EXPECT_EQ(own.tenants(0).tenant(), "clinic");
    EXPECT_EQ(all.own_tenant(), "it");
    EXPECT_EQ(own.tenants(0).running(), 1);
    EXPECT_EQ(own.tenants(0).queued(), 0);
    EXPECT_THAT(all.tenants(), ElementsAre(Property(&v1::TenantSummary::tenant, "clinic"),
                                           Property(&v1::TenantSummary::tenant, "it"),
                                           Property(&v1::TenantSummary::tenant, "surgery")));
    EXPECT_EQ(all.tenants(2).queued(), 1);
    EXPECT_EQ(all.tenants(2).oldest_queued_time().seconds(), waiting.create_time().seconds());
    EXPECT_EQ(summarize(server, surgery).tenants(0).queued(), 1);
    gate.open();
}

}  // namespace
}  // namespace remesh
