#include "server/http/gateway.h"

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <httplib.h>
#include <utility>

#include "server/http/respond.h"

namespace remesh::http {
namespace {

constexpr std::size_t kMaxBody = std::size_t{1} << 20U;
constexpr std::size_t kChunk = std::size_t{1} << 20U;

// Tenants and jobs in a path; the API checks them again.
constexpr const char* kJobPath = R"(/api/v1/(tenants/[a-z0-9-]+/jobs/[a-z0-9-]+))";

std::int64_t number_of(const std::string& text) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size() ? value : -1;
}

/// Answers with what a unary call returned.
void answer(httplib::Response& response, const grpc::Status& status,
            const google::protobuf::Message& reply) {
    status.ok() ? send(response, reply) : refuse(response, status);
}

bool parse(const httplib::Request& request, httplib::Response& response,
           google::protobuf::Message* message) {
    if (request.body.size() > kMaxBody) {
        refuse(response, 413, "BODY_TOO_LARGE", "A request must have at most 1 MiB.");
        return false;
    }
    const auto status = google::protobuf::util::JsonStringToMessage(request.body, message);
    if (!status.ok()) {
        refuse(response, 400, "BAD_JSON", std::string(status.message()));
        return false;
    }
    return true;
}

/// RFC 5987: any name becomes harmless in a header.
std::string disposition(const std::string& kind, const std::string& name) {
    constexpr std::string_view kHex = "0123456789ABCDEF";
    std::string encoded;
    for (const char c : name) {
        const auto byte = static_cast<unsigned char>(c);
        if ((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
            c == '.' || c == '-' || c == '_') {
            encoded += c;
        } else {
            encoded += '%';
            encoded += kHex[byte >> 4U];
            encoded += kHex[byte & 15U];
        }
    }
    return kind + (encoded.empty() ? "" : "; filename*=UTF-8''" + encoded);
}

using Download = StreamCall<v1::DownloadArtifactResponse>;

/// Sends what httplib asks for.
/// \param open   begins a download of `limit` bytes from `offset` on
/// \param begun  a download of everything whose `first` message was read, or null
template <typename Open>
httplib::ContentProvider sending(Open open, std::shared_ptr<Download> begun,
                                 const v1::DownloadArtifactResponse& first) {
    return [open, begun = std::move(begun), first](std::size_t offset, std::size_t length,
                                                   httplib::DataSink& sink) mutable {
        const auto send = [&sink](const std::string& bytes) {
            return sink.write(bytes.data(), bytes.size());
        };
        try {
            auto download = std::exchange(begun, nullptr);
            if (download && !send(first.data())) {
                return false;
            }
            if (!download) {
                download =
                    open(static_cast<std::int64_t>(offset), static_cast<std::int64_t>(length));
            }
            v1::DownloadArtifactResponse chunk;
            while (download->read(&chunk)) {
                if (!send(chunk.data())) {
                    return false;
                }
            }
            return download->finish().ok();
        } catch (const ShuttingDown&) {
            return false;  // The headers are out: all that is left is to hang up.
        }
    };
}

}  // namespace

Gateway::Gateway(const std::shared_ptr<grpc::Channel>& channel, const AccessRules& rules)
    : rules_(rules),
      jobs_(v1::JobService::NewStub(channel)),
      artifacts_(v1::ArtifactService::NewStub(channel)),
      capabilities_(v1::CapabilityService::NewStub(channel)),
      summaries_(v1::QueueService::NewStub(channel)),
      queue_(*jobs_, *summaries_, calls_) {}

Gateway::~Gateway() {
    close();
}

void Gateway::close() {
    queue_.close();
    calls_.close();
}

grpc::Status Gateway::check(const std::string& token) {
    Call call(calls_, token);
    v1::ListJobsRequest request;
    request.set_page_size(1);
    v1::ListJobsResponse reply;
    return jobs_->ListJobs(call.context(), request, &reply);
}

void Gateway::add_routes(httplib::Server& server) {
    add_session_routes(server);
    add_job_routes(server);
    add_artifact_routes(server);
    add_streams(server);
    server.Get("/api/v1/queue",
               [this](const httplib::Request& request, httplib::Response& response) {
                   Call call(calls_, token_of(request));
                   v1::SummarizeQueueResponse reply;
                   const auto status = summaries_->SummarizeQueue(call.context(), {}, &reply);
                   answer(response, status, reply);
               });
    server.Get("/api/v1/capabilities",
               [this](const httplib::Request& request, httplib::Response& response) {
                   Call call(calls_, token_of(request));
                   v1::GetCapabilitiesResponse reply;
                   const auto status = capabilities_->GetCapabilities(call.context(), {}, &reply);
                   answer(response, status, reply);
               });
}

void Gateway::add_session_routes(httplib::Server& server) {
    server.Post("/api/v1/session",
                [this](const httplib::Request& request, httplib::Response& response) {
                    const auto body = nlohmann::json::parse(request.body, nullptr, false);
                    const std::string token =
                        body.is_object() && body.contains("token") && body["token"].is_string()
                            ? body["token"].get<std::string>()
                            : std::string();
                    if (!is_token(token)) {
                        refuse(response, 401, "BAD_TOKEN", "This isn't a token.");
                        return;
                    }
                    if (const grpc::Status status = check(token); !status.ok()) {
                        refuse(response, status);
                        return;
                    }
                    set_token_cookie(token, rules_, response);
                    response.status = 204;
                });
    // Whether there is anything to sign out of; the cookie itself can't be seen by scripts.
    server.Get("/api/v1/session", [](const httplib::Request& request, httplib::Response& response) {
        const nlohmann::json session{{"signed_in", !token_of(request).empty()}};
        response.set_header("Cache-Control", "no-store");
        send(response, session.dump(), "application/json");
    });
    server.Delete("/api/v1/session", [this](const httplib::Request&, httplib::Response& response) {
        set_token_cookie("", rules_, response);
        response.status = 204;
    });
}

void Gateway::list_jobs(const httplib::Request& request, httplib::Response& response) {
    Call call(calls_, token_of(request));
    v1::ListJobsRequest query;
    query.set_page_token(request.get_param_value("page_token"));
    if (request.has_param("page_size")) {
        query.set_page_size(
            static_cast<std::int32_t>(number_of(request.get_param_value("page_size"))));
    }
    for (std::size_t i = 0; i < request.get_param_value_count("state"); ++i) {
        v1::Job::State state = v1::Job::STATE_UNSPECIFIED;
        v1::Job::State_Parse(request.get_param_value("state", i), &state);
        query.add_states(state);
    }
    v1::ListJobsResponse reply;
    const grpc::Status status = jobs_->ListJobs(call.context(), query, &reply);
    for (v1::Job& job : *reply.mutable_jobs()) {
        shorten(job);
    }
    answer(response, status, reply);
}

void Gateway::add_job_routes(httplib::Server& server) {
    const std::string job = kJobPath;
    server.Get("/api/v1/jobs",
               [this](const httplib::Request& request, httplib::Response& response) {
                   list_jobs(request, response);
               });
    server.Post("/api/v1/jobs",
                [this](const httplib::Request& request, httplib::Response& response) {
                    v1::CreateJobRequest create;
                    if (parse(request, response, &create)) {
                        Call call(calls_, token_of(request));
                        v1::Job reply;
                        answer(response, jobs_->CreateJob(call.context(), create, &reply), reply);
                    }
                });
    server.Get(job, [this](const httplib::Request& request, httplib::Response& response) {
        Call call(calls_, token_of(request));
        v1::GetJobRequest get;
        get.set_name(request.matches[1]);
        v1::Job reply;
        answer(response, jobs_->GetJob(call.context(), get, &reply), reply);
    });
    server.Post(job + ":cancel",
                [this](const httplib::Request& request, httplib::Response& response) {
                    Call call(calls_, token_of(request));
                    v1::CancelJobRequest cancel;
                    cancel.set_name(request.matches[1]);
                    v1::Job reply;
                    answer(response, jobs_->CancelJob(call.context(), cancel, &reply), reply);
                });
    server.Post(job + ":retry",
                [this](const httplib::Request& request, httplib::Response& response) {
                    v1::RetryJobRequest retry;
                    if (request.body.empty() || parse(request, response, &retry)) {
                        retry.set_name(request.matches[1]);
                        Call call(calls_, token_of(request));
                        v1::Job reply;
                        answer(response, jobs_->RetryJob(call.context(), retry, &reply), reply);
                    }
                });
    server.Delete(job, [this](const httplib::Request& request, httplib::Response& response) {
        Call call(calls_, token_of(request));
        v1::DeleteJobRequest remove;
        remove.set_name(request.matches[1]);
        v1::DeleteJobResponse reply;
        answer(response, jobs_->DeleteJob(call.context(), remove, &reply), reply);
    });
}

void Gateway::add_artifact_routes(httplib::Server& server) {
    const std::string artifact = "/api/v1/artifacts/([0-9a-f]{64})";
    server.Put(artifact, [this](const httplib::Request& request, httplib::Response& response,
                                const httplib::ContentReader& content) {
        upload(request, response, content);
    });
    server.Get(artifact, [this](const httplib::Request& request, httplib::Response& response) {
        download(request, response);
    });
}

void Gateway::upload(const httplib::Request& request, httplib::Response& response,
                     const httplib::ContentReader& content) {
    const std::int64_t size = number_of(request.get_header_value("Content-Length"));
    if (size < 0) {
        refuse(response, 411, "LENGTH_MISSING", "An upload needs a Content-Length.");
        return;
    }
    Call call(calls_, token_of(request));
    v1::UploadArtifactResponse reply;
    const auto stream = artifacts_->UploadArtifact(call.context(), &reply);
    call.set_begun();
    v1::UploadArtifactRequest chunk;
    chunk.mutable_digest()->set_sha256(request.matches[1]);
    chunk.mutable_digest()->set_size_bytes(size);
    std::int64_t offset = 0;
    bool is_open = true;
    const auto write = [&] {
        chunk.set_offset(offset);
        offset += static_cast<std::int64_t>(chunk.data().size());
        is_open = is_open && stream->Write(chunk);
        chunk.clear_digest();
        chunk.clear_data();
    };
    // What the API doesn't want is read all the same: the browser would see a broken connection.
    const bool is_whole = content([&](const char* data, std::size_t length) {
        while (length > 0) {
            const std::size_t part = std::min(length, kChunk - chunk.data().size());
            chunk.mutable_data()->append(data, part);
            data += part;
            length -= part;
            if (chunk.data().size() == kChunk) {
                write();
            }
        }
        return true;
    });
    if (!is_whole) {
        call.cancel();
    } else if (!chunk.data().empty() || offset == 0) {
        write();
    }
    stream->WritesDone();
    const grpc::Status status = stream->Finish();
    answer(response, status, reply);
}

void Gateway::download(const httplib::Request& request, httplib::Response& response) {
    const std::string sha256 = request.matches[1];
    const std::string token = token_of(request);
    const auto open = [this, sha256, token](std::int64_t offset, std::int64_t limit) {
        auto download = std::make_shared<Download>(calls_, token);
        v1::DownloadArtifactRequest get;
        get.set_sha256(sha256);
        get.set_offset(offset);
        get.set_limit(limit);
        download->start(artifacts_->DownloadArtifact(download->context(), get));
        return download;
    };
    // The first answer tells the size. Without a range it's the beginning of all; else httplib says
    // which part is wanted, once it knows the size.
    const bool is_whole = !request.has_header("Range");
    auto probe = open(0, is_whole ? 0 : 1);
    v1::DownloadArtifactResponse first;
    if (!probe->read(&first)) {
        refuse(response, probe->finish());
        return;
    }
    const bool is_page = request.has_param("view");
    const auto size = static_cast<std::size_t>(first.total_size_bytes());
    response.set_header("Content-Disposition", disposition(is_page ? "inline" : "attachment",
                                                           request.get_param_value("name")));
    response.set_header("Cache-Control", "private, max-age=31536000, immutable");
    response.set_header("Content-Security-Policy", kSandboxPolicy);
    const char* type = is_page ? "text/html; charset=utf-8" : "application/octet-stream";
    if (size == 0) {
        response.set_content("", type);
        return;
    }
    if (!is_whole) {
        probe.reset();
    }
    response.set_content_provider(size, type, sending(open, std::move(probe), first));
}

}  // namespace remesh::http
