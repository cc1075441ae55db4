#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "server/acceptor.h"
#include "server/artifact_service.h"
#include "server/auth/gate.h"
#include "server/convert.h"
#include "server/executor.h"
#include "server/health_service.h"
#include "server/jobs/housekeeper.h"
#include "server/jobs/worker_pool.h"
#include "server/metrics.h"
#include "server/partial_uploads.h"
#include "server/queue_service.h"
#include "server/queue_watch.h"
#include "server/reception.h"
#include "server/service.h"
#include "server/store/artifact_store.h"
#include "server/store/data_dir.h"
#include "server/store/worker_roster.h"
#include "server/tls.h"
#include "server/watch_stream.h"
#include "server/workforce.h"

namespace grpc {
class Channel;
class Server;
namespace experimental {
class ExternalConnectionAcceptor;
}
}  // namespace grpc

namespace remesh {

struct ServerOptions {
    std::filesystem::path data_dir{};
    std::string listen = "127.0.0.1:50051";  ///< HOST:PORT, port 0 for any, or unix:PATH.
    bool with_reflection = false;
    bool requires_credentials = false;  ///< Every call but health checks needs a token or a
                                        ///< client certificate that is let in.
    TlsOptions tls{};
    int max_connections = 2'000;  ///< More are closed as they come.
    std::int64_t max_artifact_bytes = std::int64_t{2} << 30;
    Inspector inspector = inspect_surface;  ///< For InspectArtifact.
    /// So many jobs of all tenants that none of them fills the queue alone.
    RegistryOptions registry{.limits = {.max_queued = 10'000}};
    WorkforceOptions workforce{};
    HousekeeperOptions housekeeping{};
    WatchOptions watches{};
    TransferOptions transfers{};
    CallOptions calls{};
};

/// A whole server but for its process: data directory, registry, workers (here or in processes of
/// their own) and the gRPC port.
class Server {
public:
    /// \throws StoreError if the data directory can't be used; std::runtime_error if the address
    /// can't be
    Server(const ServerOptions& options, const Engine& engine);
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;
    /// Shuts down if that wasn't done.
    ~Server();

    /// Lets callers in; for those who come by HTTP, too.
    [[nodiscard]] Gate& gate() { return gate_; }
    /// Chosen port; 1 for a Unix socket.
    [[nodiscard]] int port() const { return acceptor_->port(); }
    [[nodiscard]] bool is_ready() const;
    /// To the same services as the port, for what in this process speaks for callers.
    [[nodiscard]] std::shared_ptr<grpc::Channel> in_process_channel();
    [[nodiscard]] Metrics& metrics() { return metrics_; }

    /// Refuses new jobs, gives running ones back to the queue, ends watches, closes the port.
    ///
    /// \param grace  runs that don't stop within it are given back all the same
    /// \return whether all runs stopped; if not, the process must end without destroying this
    bool shut_down(std::chrono::milliseconds grace);

private:
    /// Ends what the registry tells before those who hear it are gone, also if a server can't be
    /// made.
    class Listening {
    public:
        explicit Listening(JobRegistry& registry) : registry_(registry) {}
        Listening(const Listening&) = delete;
        Listening& operator=(const Listening&) = delete;
        ~Listening() { registry_.stop_listening(); }

    private:
        JobRegistry& registry_;
    };

    void listen(const ServerOptions& options);

    DataDir data_dir_;
    WorkerRoster roster_;
    std::unique_ptr<JobStore> store_;
    ArtifactStore artifacts_;
    PartialUploads uploads_;
    Gate gate_;
    ProtoCodec codec_;
    Executor executor_;
    Reception reception_;
    JobRegistry registry_;
    WatchHub watches_;
    QueueHub queue_watches_;
    Metrics metrics_;
    Listening listening_{registry_};
    JobService jobs_;
    ArtifactService artifact_service_;
    CapabilityService capabilities_;
    QueueService queue_service_;
    HealthService health_;
    std::unique_ptr<Acceptor> acceptor_;
    std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> door_;
    std::unique_ptr<grpc::Server> server_;
    Housekeeper housekeeper_;
    std::unique_ptr<Workforce> workforce_;
};

}  // namespace remesh
