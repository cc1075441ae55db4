#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "server/artifact_service.h"
#include "server/convert.h"
#include "server/executor.h"
#include "server/jobs/housekeeper.h"
#include "server/service.h"
#include "server/store/artifact_store.h"
#include "server/store/data_dir.h"
#include "server/store/worker_roster.h"
#include "server/watch_stream.h"
#include "server/workforce.h"

namespace grpc {
class Server;
}

namespace remesh {

struct ServerOptions {
    std::filesystem::path data_dir{};
    std::string listen = "127.0.0.1:50051";  ///< HOST:PORT, port 0 for any, or unix:PATH.
    bool with_reflection = false;
    std::int64_t max_artifact_bytes = std::int64_t{2} << 30;
    RegistryOptions registry{};
    WorkforceOptions workforce{};
    HousekeeperOptions housekeeping{};
    WatchOptions watches{};
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

    /// Chosen port; 1 for a Unix socket.
    [[nodiscard]] int port() const { return port_; }
    [[nodiscard]] bool is_ready() const;

    /// Refuses new jobs, gives running ones back to the queue, ends watches, closes the port.
    ///
    /// \param grace  runs that don't stop within it are given back all the same
    /// \return whether all runs stopped; if not, the process must end without destroying this
    bool shut_down(std::chrono::milliseconds grace);

private:
    void listen(const ServerOptions& options);

    DataDir data_dir_;
    WorkerRoster roster_;
    std::unique_ptr<JobStore> store_;
    ArtifactStore artifacts_;
    ProtoCodec codec_;
    Executor executor_;
    JobRegistry registry_;
    WatchHub watches_;
    JobService jobs_;
    ArtifactService artifact_service_;
    CapabilityService capabilities_;
    int port_ = 0;
    std::unique_ptr<grpc::Server> server_;
    Housekeeper housekeeper_;
    std::unique_ptr<Workforce> workforce_;
};

}  // namespace remesh
