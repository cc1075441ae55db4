#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/service/prometheus_text.h"
#include "tests/support/scripted_engine.h"
#include "tests/support/test_server.h"

namespace remesh::testing {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Key;
using ::testing::Not;

PrometheusText scrape(TestServer& server) {
    server.server().metrics().settle();
    return PrometheusText(server.server().metrics().text());
}

TEST(Metrics, StartAtZeroForEveryStateAndReason) {
    const ScriptedEngine engine;
    TestServer server(engine);

    const PrometheusText text = scrape(server);

    EXPECT_EQ(text.value("remesh_jobs_created_total"), 0.0);
    EXPECT_EQ(text.value(R"(remesh_jobs{state="queued"})"), 0.0);
    EXPECT_EQ(text.value(R"(remesh_jobs_ended_total{reason="NONE",state="succeeded"})"), 0.0);
    EXPECT_EQ(text.value(R"(remesh_jobs_ended_total{reason="TIMEOUT",state="failed"})"), 0.0);
    EXPECT_EQ(text.value("remesh_queue_oldest_seconds"), 0.0);
    EXPECT_EQ(text.value("remesh_ready"), 1.0);
}

TEST(Metrics, CountJobsStagesAndTheirTimes) {
    const ScriptedEngine engine;
    TestServer server(engine);
    server.wait_for(server.create("one").name(), v1::Job::STATE_SUCCEEDED);
    server.wait_for(server.create("two").name(), v1::Job::STATE_SUCCEEDED);

    const PrometheusText text = scrape(server);

    EXPECT_EQ(text.value("remesh_jobs_created_total"), 2.0);
    EXPECT_EQ(text.value(R"(remesh_jobs{state="succeeded"})"), 2.0);
    EXPECT_EQ(text.value(R"(remesh_jobs_ended_total{reason="NONE",state="succeeded"})"), 2.0);
    EXPECT_EQ(text.value("remesh_queue_wait_seconds_count"), 2.0);
    EXPECT_EQ(text.value(R"(remesh_attempt_duration_seconds_count{state="succeeded"})"), 2.0);
    EXPECT_EQ(text.value(R"(remesh_stage_duration_seconds_count{stage="relax"})"), 2.0);
}

TEST(Metrics, CountFailuresByReason) {
    const ScriptedEngine engine(
        [](const JobRequest&, const JobFiles&, RunContext&, OutputSink&) -> JobResult {
            throw Error(ErrorCode::Unmeshable, "no");
        });
    TestServer server(engine);
    server.wait_for(server.create("one").name(), v1::Job::STATE_FAILED);

    const PrometheusText text = scrape(server);

    EXPECT_EQ(text.value(R"(remesh_jobs_ended_total{reason="UNMESHABLE",state="failed"})"), 1.0);
    EXPECT_EQ(text.value(R"(remesh_attempt_duration_seconds_count{state="failed"})"), 1.0);
}

TEST(Metrics, TellTheAgeOfTheQueue) {
    Gate gate;
    const ScriptedEngine engine(behind(gate));
    TestServer server(engine);
    server.wait_for(server.create("runs").name(), v1::Job::STATE_RUNNING);
    const std::string waiting = server.create("waits").name();

    const PrometheusText text = scrape(server);
    gate.open();

    EXPECT_EQ(text.value(R"(remesh_jobs{state="running"})"), 1.0);
    EXPECT_EQ(text.value(R"(remesh_jobs{state="queued"})"), 1.0);
    EXPECT_GE(text.value("remesh_queue_oldest_seconds"), 0.0);
    server.wait_for(waiting, v1::Job::STATE_SUCCEEDED);
}

TEST(Metrics, CountAttemptsThatAStoppingServerGaveBack) {
    Gate gate;
    const ScriptedEngine engine(behind(gate));
    TestServer server(engine);
    const std::string name = server.create("one").name();
    server.wait_for(name, v1::Job::STATE_RUNNING);

    server.stop();
    gate.open();
    server.start();
    server.wait_for(name, v1::Job::STATE_SUCCEEDED);
    const PrometheusText text = scrape(server);

    // What was before belongs to the process before.
    EXPECT_EQ(text.value("remesh_jobs_created_total"), 0.0);
    EXPECT_EQ(text.value("remesh_attempts_lost_total"), 0.0);
    EXPECT_EQ(text.value(R"(remesh_jobs_ended_total{reason="NONE",state="succeeded"})"), 1.0);
}

TEST(Metrics, AreNamedByTheRules) {
    const ScriptedEngine engine;
    TestServer server(engine);
    const std::string name = server.create("one").name();
    server.wait_for(name, v1::Job::STATE_SUCCEEDED);
    server.server().metrics().count_response(200);

    const PrometheusText text = scrape(server);

    for (const auto& [family, type] : text.types()) {
        EXPECT_EQ(type == "counter", family.ends_with("_total")) << family;
        if (type == "histogram") {
            EXPECT_TRUE(family.ends_with("_seconds") || family.ends_with("_bytes")) << family;
        }
    }
    const std::string id = name.substr(name.rfind('/') + 1);
    EXPECT_THAT(text.samples(), Each(Key(Not(HasSubstr(id)))));
    EXPECT_THAT(text.samples(), Each(Key(Not(HasSubstr("tenant")))));
}

}  // namespace
}  // namespace remesh::testing
