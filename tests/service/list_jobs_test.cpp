#include <gtest/gtest.h>

#include "tests/support/test_server.h"

namespace remesh {
namespace {

using testing::CallContext;
using testing::ScriptedEngine;
using testing::TestServer;

const ScriptedEngine kCopy;

TEST(Service, ListsJobsInPages) {
    TestServer server(kCopy);
    std::vector<std::string> names;
    for (int i = 0; i < 5; ++i) {
        names.insert(names.begin(), server.create("mesh " + std::to_string(i)).name());
        server.watch(names.front());
    }

    std::vector<std::string> listed;
    v1::ListJobsRequest request;
    request.set_page_size(2);
    do {
        CallContext context;
        v1::ListJobsResponse page;
        ASSERT_TRUE(server.jobs->ListJobs(&context, request, &page).ok());
        for (const v1::Job& job : page.jobs()) {
            listed.push_back(job.name());
        }
        request.set_page_token(page.next_page_token());
    } while (!request.page_token().empty());
    request.set_page_token("nonsense");
    CallContext context;
    v1::ListJobsResponse page;

    EXPECT_EQ(listed, names);
    EXPECT_EQ(server.jobs->ListJobs(&context, request, &page).error_code(),
              grpc::StatusCode::INVALID_ARGUMENT);
}

TEST(Service, GoesOnListingAfterARestart) {
    TestServer server(kCopy);
    const std::string first = server.create("one").name();
    const std::string second = server.create("two").name();
    const auto list = [&](const std::string& token) {
        CallContext context;
        v1::ListJobsRequest request;
        request.set_page_size(1);
        request.set_page_token(token);
        v1::ListJobsResponse page;
        EXPECT_TRUE(server.jobs->ListJobs(&context, request, &page).ok());
        return page;
    };

    const v1::ListJobsResponse before = list("");
    server.stop();
    server.start();
    const v1::ListJobsResponse after = list(before.next_page_token());

    EXPECT_EQ(before.jobs(0).name(), second);
    EXPECT_EQ(after.jobs(0).name(), first);
    EXPECT_EQ(after.next_page_token(), "");
}

TEST(Service, EndsAPageBeforeItPassesAMessage) {
    TestServer server(kCopy);
    v1::CreateJobRequest request = server.request_for("mesh");
    request.mutable_spec()
        ->mutable_options()
        ->mutable_sizing()
        ->add_regions()
        ->mutable_points()
        ->mutable_coordinates()
        ->Resize(150'000, 1.0);
    std::vector<std::string> names;
    for (int seed = 0; seed < 5; ++seed) {
        request.mutable_spec()->mutable_options()->set_seed(seed);
        v1::Job job;
        ASSERT_TRUE(server.create(request, &job).ok());
        names.insert(names.begin(), job.name());
    }

    std::vector<std::string> listed;
    v1::ListJobsRequest asked;
    do {
        CallContext context;
        v1::ListJobsResponse page;
        const grpc::Status status = server.jobs->ListJobs(&context, asked, &page);
        ASSERT_TRUE(status.ok()) << status.error_message();
        for (const v1::Job& job : page.jobs()) {
            listed.push_back(job.name());
        }
        asked.set_page_token(page.next_page_token());
    } while (!asked.page_token().empty());

    EXPECT_EQ(listed, names);
}

}  // namespace
}  // namespace remesh
