#include "server/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>

#include <stdexcept>

#include "server/store/sqlite_job_store.h"

namespace remesh {
namespace {

// For what waits on the disk: uploads, downloads and the calls that write.
constexpr int kExecutorThreads = 4;

constexpr int kMaxMessageBytes = 4 << 20;
constexpr int kMaxMetadataBytes = 16 << 10;
constexpr int kMaxStreamsPerConnection = 4'096;
constexpr int kKeepaliveMs = 60'000;
constexpr int kMinPingIntervalMs = 10'000;
constexpr std::size_t kMaxBufferBytes = std::size_t{512} << 20U;

std::unique_ptr<JobStore> open_whole_store(const std::filesystem::path& file) {
    check_sqlite_store(file);
    return open_sqlite_store(file);
}

}  // namespace

Server::Server(const ServerOptions& options, const Engine& engine)
    : data_dir_(options.data_dir),
      roster_(data_dir_.path()),
      store_(open_whole_store(data_dir_.path() / "remesh.sqlite")),
      artifacts_(data_dir_.path(), *store_),
      executor_(kExecutorThreads),
      registry_(*store_, artifacts_, codec_, engine, options.registry),
      watches_(registry_, options.watches),
      jobs_(registry_, artifacts_, watches_, executor_),
      artifact_service_(artifacts_, executor_, options.max_artifact_bytes,
                        options.registry.limits.max_bytes_of_tenant,
                        [this] { return registry_.is_draining(); }),
      capabilities_({options.max_artifact_bytes, options.workforce.workers.workers,
                     options.workforce.workers.threads, options.registry.limits.max_queued}),
      housekeeper_(
          *store_, artifacts_, registry_, codec_,
          [this](const std::string& worker) { return roster_.is_alive(worker); },
          options.housekeeping) {
    housekeeper_.take_up(system_now());
    housekeeper_.clean_up(system_now());
    roster_.tidy();
    registry_.set_listener([this](const JobKey& key) { watches_.notify(key); });
    listen(options);
    workforce_ = std::make_unique<Workforce>(*store_, artifacts_, roster_, codec_, engine,
                                             options.workforce);
    housekeeper_.start();
}

Server::~Server() {
    if (workforce_) {
        shut_down(std::chrono::hours(1));
    }
    registry_.stop_listening();  // the watches are gone before it is
}

void Server::listen(const ServerOptions& options) {
    grpc::EnableDefaultHealthCheckService(true);
    if (options.with_reflection) {
        grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    }
    grpc::ResourceQuota quota("remeshd");
    quota.Resize(kMaxBufferBytes);
    grpc::ServerBuilder builder;
    builder.SetResourceQuota(quota);
    builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
    builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMaxStreamsPerConnection);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                               kMinPingIntervalMs);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
    builder.AddListeningPort(options.listen, grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(&jobs_);
    builder.RegisterService(&artifact_service_);
    builder.RegisterService(&capabilities_);
    server_ = builder.BuildAndStart();
    if (!server_ || port_ == 0) {
        throw std::runtime_error("can't listen on " + options.listen);
    }
}

bool Server::is_ready() const {
    return !registry_.is_draining();
}

bool Server::shut_down(std::chrono::milliseconds grace) {
    server_->GetHealthCheckService()->SetServingStatus(false);
    registry_.drain();
    workforce_->drain();
    const bool is_idle = workforce_->finish(grace);
    watches_.close();
    server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(1));
    server_->Wait();
    if (is_idle) {
        workforce_.reset();
    }
    return is_idle;
}

}  // namespace remesh
