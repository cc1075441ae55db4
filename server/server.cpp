#include "server/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>

#include <stdexcept>

#include "server/doorkeeper.h"
#include "server/store/sqlite_job_store.h"

namespace remesh {
namespace {

// For what waits on the disk: uploads, downloads and the calls that write.
constexpr int kExecutorThreads = 4;

constexpr int kMaxMessageBytes = 4 << 20;
constexpr int kMaxMetadataBytes = 16 << 10;
constexpr int kMaxStreamsPerConnection = 4'096;
constexpr std::size_t kMaxHealthCalls = 1'024;
constexpr int kKeepaliveMs = 60'000;
constexpr int kMinPingIntervalMs = 10'000;
constexpr int kHandshakeMs = 10'000;
// A connection without a call is closed after this.
constexpr int kMaxIdleMs = 15 * 60'000;
// Bytes of a stream that may be on their way before they are read.
constexpr int kLookaheadBytes = 4 << 20;
constexpr std::size_t kMaxBufferBytes = std::size_t{512} << 20U;

std::unique_ptr<JobStore> open_whole_store(const std::filesystem::path& data_dir) {
    require_whole_database(data_dir / "access.sqlite");
    check_sqlite_store(data_dir / "remesh.sqlite");
    return open_sqlite_store(data_dir / "remesh.sqlite");
}

HousekeeperOptions with_uploads(HousekeeperOptions options, const PartialUploads& uploads) {
    options.remove_uploads = [&uploads](Time before) { uploads.remove_abandoned(before); };
    return options;
}

}  // namespace

Server::Server(const ServerOptions& options, const Engine& engine)
    : data_dir_(options.data_dir),
      roster_(data_dir_.path()),
      store_(open_whole_store(data_dir_.path())),
      artifacts_(data_dir_.path(), *store_),
      uploads_(data_dir_.path()),
      gate_(data_dir_.path(), options.requires_credentials),
      executor_(kExecutorThreads),
      reception_(gate_, executor_, options.calls),
      registry_(*store_, artifacts_, codec_, engine, options.registry),
      watches_(registry_, options.watches,
               [this](const Principal& who) { return gate_.is_still_valid(who); }),
      queue_watches_(registry_, options.watches,
                     [this](const Principal& who) { return gate_.is_still_valid(who); }),
      metrics_(registry_, *store_,
               {.data_dir = options.data_dir, .certificate = options.tls.certificate}),
      jobs_(gate_, registry_, artifacts_, watches_, queue_watches_, executor_, reception_),
      artifact_service_(
          {gate_, artifacts_, uploads_, executor_, options.max_artifact_bytes,
           options.registry.limits.max_bytes_of_tenant, [this] { return registry_.is_draining(); },
           std::make_shared<TenantSlots>("transfers", options.transfers.max_transfers,
                                         options.transfers.max_transfers_of_tenant)},
          options.inspector, reception_),
      capabilities_(reception_,
                    {options.max_artifact_bytes, options.workforce.workers.workers,
                     options.workforce.workers.threads, options.registry.limits.max_queued}),
      queue_service_(reception_, *store_, registry_),
      health_(kMaxHealthCalls),
      housekeeper_(
          *store_, artifacts_, registry_, codec_,
          [this](const std::string& worker) { return roster_.is_alive(worker); },
          with_uploads(options.housekeeping, uploads_)) {
    registry_.set_listener([this](const JobKey& key) {
        metrics_.notify(key);  // First: who sees a change in a watch finds it counted.
        watches_.notify(key);
        queue_watches_.notify(key);
    });
    housekeeper_.take_up(system_now());
    housekeeper_.clean_up(system_now());
    roster_.tidy();
    listen(options);
    workforce_ = std::make_unique<Workforce>(*store_, artifacts_, roster_, codec_, engine,
                                             options.workforce);
    housekeeper_.start();
}

Server::~Server() {
    if (workforce_) {
        shut_down(std::chrono::hours(1));
    }
}

void Server::listen(const ServerOptions& options) {
    if (options.with_reflection) {
        grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    }
    grpc::ResourceQuota quota("remeshd");
    quota.Resize(kMaxBufferBytes);
    grpc::ServerBuilder builder;
    builder.SetResourceQuota(quota);
    builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
    builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
    builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMaxStreamsPerConnection);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                               kMinPingIntervalMs);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
    builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, kHandshakeMs);
    builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, kMaxIdleMs);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, kLookaheadBytes);
    acceptor_ = std::make_unique<Acceptor>(options.listen, options.max_connections);
    const auto credentials = server_credentials(options.tls);
    if (options.requires_credentials && options.tls.is_on()) {
        credentials->SetAuthMetadataProcessor(std::make_shared<Doorkeeper>(gate_));
    }
    door_ = builder.experimental().AddExternalConnectionAcceptor(
        grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD, credentials);
    builder.RegisterService(&jobs_);
    builder.RegisterService(&artifact_service_);
    builder.RegisterService(&capabilities_);
    builder.RegisterService(&queue_service_);
    builder.RegisterCallbackGenericService(&health_);
    server_ = builder.BuildAndStart();
    if (!server_) {
        throw std::runtime_error("can't serve on " + options.listen);
    }
    acceptor_->start([this](int listener, int connection) {
        grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
        parameters.listener_fd = listener;
        parameters.fd = connection;
        door_->HandleNewConnection(&parameters);
    });
}

std::shared_ptr<grpc::Channel> Server::in_process_channel() {
    return server_->InProcessChannel({});
}

bool Server::is_ready() const {
    return !registry_.is_draining();
}

bool Server::shut_down(std::chrono::milliseconds grace) {
    health_.stop_serving();
    registry_.drain();
    workforce_->drain();
    const bool is_idle = workforce_->finish(grace);
    watches_.close();
    queue_watches_.close();
    acceptor_->stop();
    server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(1));
    server_->Wait();
    if (is_idle) {
        workforce_.reset();
    }
    return is_idle;
}

}  // namespace remesh
