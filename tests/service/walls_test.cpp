// Every call of the contract as another tenant, as nobody, and as one who may only look.
//
// The calls are found in the generated descriptors and filled by reflection, so that a new one that
// forgets to ask who calls, or whose it is, fails here without anybody thinking of it.

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor_database.h>
#include <google/protobuf/dynamic_message.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <future>
#include <thread>
#include <vector>

#include "server/healthcheck.h"
#include "tests/support/test_server.h"

namespace remesh {
namespace {

namespace pb = google::protobuf;
using ::testing::AnyOf;
using testing::CallContext;
using testing::ScriptedEngine;
using testing::TestServer;

const ScriptedEngine kCopy;

/// All methods of our services that are linked in: what the server could serve.
std::vector<const pb::MethodDescriptor*> all_methods() {
    std::vector<std::string> files;
    pb::DescriptorPool::internal_generated_database()->FindAllFileNames(&files);
    std::vector<const pb::MethodDescriptor*> methods;
    for (const std::string& name : files) {
        if (!name.starts_with("remesh/")) {
            continue;
        }
        const pb::FileDescriptor* file = pb::DescriptorPool::generated_pool()->FindFileByName(name);
        for (int s = 0; s < file->service_count(); ++s) {
            for (int m = 0; m < file->service(s)->method_count(); ++m) {
                methods.push_back(file->service(s)->method(m));
            }
        }
    }
    return methods;
}

/// What the fields of a request are filled with.
struct Names {
    std::string tenant{};
    std::string job{};
    std::string etag{};
    std::string request_id{};
    v1::Digest digest{};
};

void fill(pb::Message& message, const Names& names);

void fill_message(pb::Message& message, const pb::FieldDescriptor* field, const Names& names) {
    const std::string& type = field->message_type()->full_name();
    if (field->is_map() || type.starts_with("google.") || type == "remesh.v1.Options" ||
        type == "remesh.v1.Frame") {
        return;  // Values that could only make the request a bad one.
    }
    const pb::Reflection& reflection = *message.GetReflection();
    fill(field->is_repeated() ? *reflection.AddMessage(&message, field)
                              : *reflection.MutableMessage(&message, field),
         names);
}

void fill(pb::Message& message, const Names& names) {
    const std::map<std::string, std::string> words{
        {"name", "tenants/" + names.tenant + "/jobs/" + names.job},
        {"parent", "tenants/" + names.tenant},
        {"sha256", names.digest.sha256()},
        {"etag", names.etag},
        {"request_id", names.request_id}};
    const pb::Reflection& reflection = *message.GetReflection();
    const pb::Descriptor& type = *message.GetDescriptor();
    for (int i = 0; i < type.field_count(); ++i) {
        const pb::FieldDescriptor* field = type.field(i);
        if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
            fill_message(message, field, names);
        } else if (words.contains(field->name()) && !field->is_repeated()) {
            reflection.SetString(&message, field, words.at(field->name()));
        } else if (field->name() == "size_bytes") {
            reflection.SetInt64(&message, field, names.digest.size_bytes());
        } else if (field->name() == "format") {
            reflection.SetEnumValue(&message, field, v1::FORMAT_STL);
        }
    }
}

std::string request_for(const pb::MethodDescriptor& method, const Names& names) {
    const std::unique_ptr<pb::Message> request(
        pb::MessageFactory::generated_factory()->GetPrototype(method.input_type())->New());
    fill(*request, names);
    return request->SerializeAsString();
}

struct Answer {
    grpc::Status status{};
    std::string messages{};

    /// Everything that the caller can see.
    [[nodiscard]] std::string text() const {
        return std::to_string(status.error_code()) + "|" + status.error_message() + "|" +
               status.error_details() + "|" + messages;
    }
};

void replace_all(std::string& text, const std::string& from, const std::string& to) {
    for (auto at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
        text.replace(at, from.size(), to);
    }
}

/// Makes any call with one message. Of endless streams only the first two messages are read.
Answer call(const std::shared_ptr<grpc::Channel>& channel, const pb::MethodDescriptor& method,
            const std::string& request, const std::string& token) {
    CallContext context(token);
    grpc::CompletionQueue queue;
    grpc::GenericStub stub(channel);
    const auto stream = stub.PrepareCall(
        &context, "/" + method.service()->full_name() + "/" + method.name(), &queue);
    const auto done = [&queue] {
        void* tag = nullptr;
        bool ok = false;
        queue.Next(&tag, &ok);
        return ok;
    };
    stream->StartCall(nullptr);
    done();
    const grpc::Slice slice(request);
    stream->Write(grpc::ByteBuffer(&slice, 1), nullptr);
    if (done()) {
        stream->WritesDone(nullptr);
        done();
    }
    Answer answer;
    for (int i = 0; i < 2; ++i) {
        grpc::ByteBuffer bytes;
        stream->Read(&bytes, nullptr);
        if (!done()) {
            break;
        }
        grpc::Slice message;
        bytes.DumpToSingleSlice(&message);
        answer.messages.append(reinterpret_cast<const char*>(message.begin()), message.size());
        if (i == 1) {
            context.TryCancel();
        }
    }
    stream->Finish(&answer.status, nullptr);
    done();
    return answer;
}

class Walls : public ::testing::TestWithParam<const pb::MethodDescriptor*> {
protected:
    Walls()
        : server_(kCopy, [](ServerOptions& options) {
              options.requires_credentials = true;
              options.watches.heartbeat = std::chrono::milliseconds(20);
          }) {
        server_.token = victim_ = server_.token_for("victim");
        v1::CreateJobRequest request = server_.request_for("a face");
        request.set_request_id("request-1");
        server_.create(request, &job_);
        job_ = server_.watch(job_.name()).back().completed();
        names_ = {"victim", job_.name().substr(job_.name().rfind('/') + 1), job_.etag(),
                  "request-1", job_.spec().input().digest()};
    }

    Answer ask(const Names& names, const std::string& token) {
        return call(server_.channel, *GetParam(), request_for(*GetParam(), names), token);
    }

    TestServer server_;
    std::string victim_;
    v1::Job job_;
    Names names_;
};

TEST_P(Walls, TellNobodyAnything) {
    for (const std::string token : {"", "wrong", "remesh_0000"}) {
        const Answer answer = ask(names_, token);

        EXPECT_EQ(answer.status.error_code(), grpc::StatusCode::UNAUTHENTICATED);
        EXPECT_EQ(answer.messages, "");
        EXPECT_EQ(answer.text().find(names_.job), std::string::npos);
    }
}

TEST_P(Walls, AnswerAnotherTenantAsIfThereWereNothing) {
    const std::string stranger = server_.token_for("stranger");
    Names nothing{"nobody", std::string(names_.job.size(), '0'), names_.etag, "request-2",
                  names_.digest};
    nothing.digest.set_sha256(sha256_of("no face"));
    v1::Job before;
    ASSERT_TRUE(server_.get(job_.name(), &before).ok());

    const auto text_of = [&](const Answer& answer) {
        std::string text = answer.text();
        for (const auto& [from, to] : {std::pair{names_.job, nothing.job},
                                       {names_.tenant, nothing.tenant},
                                       {names_.request_id, nothing.request_id},
                                       {names_.digest.sha256(), nothing.digest.sha256()}}) {
            replace_all(text, from, to);
        }
        return text;
    };
    const Answer real = ask(names_, stranger);
    const Answer unreal = ask(nothing, stranger);
    const Answer again = ask(names_, stranger);

    EXPECT_FALSE(GetParam()->server_streaming() && real.status.ok())
        << "a stream let a stranger in";
    // An answer that tells the minute may change between two questions, but not between all three.
    EXPECT_THAT(text_of(unreal), AnyOf(text_of(real), text_of(again)));
    v1::Job after;
    ASSERT_TRUE(server_.get(job_.name(), &after).ok());
    EXPECT_EQ(after.SerializeAsString(), before.SerializeAsString());
}

TEST_P(Walls, ShowAnotherTenantItsOwnThingsOnly) {
    const std::string stranger = server_.token_for("stranger");

    const Answer answer = ask({"stranger", "", "", "", {}}, stranger);

    EXPECT_EQ(answer.text().find(names_.job), std::string::npos);
    EXPECT_EQ(answer.text().find("victim"), std::string::npos);
    EXPECT_EQ(answer.text().find(names_.digest.sha256()), std::string::npos);
}

TEST_P(Walls, LetTheOwnerIn) {
    const Answer answer = ask(names_, victim_);

    EXPECT_NE(answer.status.error_code(), grpc::StatusCode::UNAUTHENTICATED);
    EXPECT_NE(answer.status.error_code(), grpc::StatusCode::PERMISSION_DENIED);
    EXPECT_NE(answer.status.error_code(), grpc::StatusCode::NOT_FOUND);
    EXPECT_NE(answer.status.error_code(), grpc::StatusCode::UNIMPLEMENTED);
}

TEST_P(Walls, LetAViewerChangeNothing) {
    const std::string viewer = server_.token_for("victim", Role::Viewer);

    const Answer answer = ask(names_, viewer);

    const std::set<std::string> reads{"GetJob",          "ListJobs",         "WatchJob",
                                      "WatchQueue",      "DownloadArtifact", "FindMissingArtifacts",
                                      "InspectArtifact", "GetCapabilities",  "SummarizeQueue"};
    EXPECT_EQ(answer.status.error_code() == grpc::StatusCode::PERMISSION_DENIED,
              !reads.contains(GetParam()->name()))
        << answer.status.error_message();
}

INSTANTIATE_TEST_SUITE_P(Calls, Walls, ::testing::ValuesIn(all_methods()),
                         [](const auto& method) { return method.param->name(); });

TEST(WallsTest, KnowsTheCalls) {
    EXPECT_GE(all_methods().size(), 14U);
}

TEST(Health, IsAskedWithoutCredentials) {
    TestServer server(kCopy, [](ServerOptions& options) { options.requires_credentials = true; });

    EXPECT_TRUE(is_serving(server.address()));
}

TEST(Tokens, LetInNobodyOnceRevoked) {
    TestServer server(kCopy, [](ServerOptions& options) { options.requires_credentials = true; });
    server.token = server.token_for("a");
    const std::string job = server.create("mesh").name();
    AccessStore access(server.data_dir());

    access.revoke(access.list().at(0).id, system_now());

    v1::Job reply;
    EXPECT_EQ(server.get(job, &reply).error_code(), grpc::StatusCode::UNAUTHENTICATED);
}

TEST(Tokens, EndTheWatchesOfThoseThatAreRevoked) {
    testing::Gate gate;
    const ScriptedEngine engine(testing::behind(gate));
    TestServer server(engine, [](ServerOptions& options) {
        options.requires_credentials = true;
        options.watches.heartbeat = std::chrono::milliseconds(20);
    });
    server.token = server.token_for("a");
    const std::string job = server.create("mesh").name();
    AccessStore access(server.data_dir());
    grpc::Status status;

    server.watch(job, 0, &status, [&](const v1::JobEvent&) {
        access.revoke(access.list().at(0).id, system_now());
        return false;
    });

    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAUTHENTICATED);
    gate.open();
}

TEST(Names, MayBeShort) {
    TestServer server(kCopy);
    const std::string name = server.create("mesh").name();
    v1::Job job;

    EXPECT_TRUE(server.get(name.substr(name.rfind('/') + 1), &job).ok());

    EXPECT_EQ(job.name(), name);
}

TEST(Tokens, EndTheTransfersOfThoseThatAreRevoked) {
    TestServer server(kCopy, [](ServerOptions& options) { options.requires_credentials = true; });
    CallContext context(server.token_for("a"));
    AccessStore access(server.data_dir());
    v1::UploadArtifactRequest chunk;
    chunk.mutable_digest()->set_sha256(sha256_of("mesh"));
    chunk.mutable_digest()->set_size_bytes(4);
    chunk.set_data("me");
    v1::UploadArtifactResponse response;
    const auto stream = server.artifacts->UploadArtifact(&context, &response);
    stream->Write(chunk);
    // Let in, and the first chunk kept.
    const auto part = server.data_dir() / "tenants" / "a" / "uploads" / sha256_of("mesh");
    std::error_code error;
    while (std::filesystem::file_size(part, error) != 2) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }

    access.revoke(access.list().at(0).id, system_now());
    chunk.set_offset(2);
    chunk.set_data("sh");
    stream->Write(chunk);
    stream->WritesDone();

    EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::UNAUTHENTICATED);
}

TEST(Inspections, LetNobodyWaitAmongThoseWhoMayLook) {
    std::promise<void> end;
    TestServer server(kCopy, [ended = end.get_future().share()](ServerOptions& options) {
        options.requires_credentials = true;
        options.inspector = [ended](std::string_view, const std::string&) {
            ended.wait();
            return v1::Inspection();
        };
    });
    server.token = server.token_for("a");
    const std::string digest = server.upload("mesh").sha256();
    const auto inspect = [&](const std::string& token) {
        CallContext context(token);
        v1::InspectArtifactRequest request;
        request.set_sha256(digest);
        v1::Inspection inspection;
        return server.artifacts->InspectArtifact(&context, request, &inspection).error_code();
    };
    std::atomic<int> turned_away = 0;
    std::vector<std::jthread> callers;
    for (int i = 0; i < 9; ++i) {
        callers.emplace_back([&] {
            if (inspect(server.token) == grpc::StatusCode::RESOURCE_EXHAUSTED) {
                ++turned_away;
                turned_away.notify_all();
            }
        });
    }

    turned_away.wait(0);  // Eight of them wait.
    EXPECT_EQ(inspect(""), grpc::StatusCode::UNAUTHENTICATED);

    end.set_value();
    callers.clear();
    EXPECT_EQ(turned_away, 1);
}

TEST(Pages, TellNobodyHowManyJobsOthersHave) {
    const PageTokens tokens("key");

    const std::string token = tokens.seal("a", 7);

    EXPECT_EQ(tokens.open("a", token), 7);
    EXPECT_EQ(tokens.open("b", token), std::nullopt);
    EXPECT_EQ(PageTokens("other key").open("a", token), std::nullopt);
    EXPECT_EQ(tokens.open("a", "7"), std::nullopt);
    EXPECT_EQ(tokens.open("a", std::string(32, '0')), std::nullopt);
    EXPECT_NE(tokens.seal("a", 8).substr(0, 16), token.substr(0, 16));
}

TEST(Audit, TellsWhoDidWhat) {
    TestServer server(kCopy, [](ServerOptions& options) { options.requires_credentials = true; });
    server.token = server.token_for("clinic");
    const std::string job = server.create("mesh").name();
    server.watch(job);
    server.remove(job);

    std::vector<std::string> lines;
    AuditLog log(server.data_dir());
    log.for_each([&](const AuditRecord& record) {
        lines.push_back(record.entry.tenant + " " + record.entry.action + " " +
                        record.entry.outcome);
        EXPECT_TRUE(record.entry.actor.starts_with("token:"));
    });

    EXPECT_THAT(lines, ::testing::ElementsAre("clinic UploadArtifact OK", "clinic CreateJob OK",
                                              "clinic DeleteJob OK"));
    EXPECT_EQ(log.verify().trouble, "");
}

}  // namespace
}  // namespace remesh
