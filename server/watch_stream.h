#pragma once

#include <grpcpp/support/server_callback.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <stop_token>
#include <thread>

#include "remesh/v1/job.pb.h"
#include "server/jobs/registry.h"

namespace remesh {

struct WatchOptions {
    std::size_t max_watches = 2'000;              ///< More are refused.
    std::chrono::milliseconds heartbeat{15'000};  ///< Longest silence of a stream.
    std::int64_t max_backlog = 64;  ///< A reader further behind than this gets thinned samples.
};

class WatchStream;

/// Feeds all WatchJob streams from one thread.
///
/// The store is the buffer: a stream is a cursor into its job's events with at most one message in
/// flight, so a slow or dead reader costs no memory. What was there when the stream opened is sent
/// in full; of what comes later, a reader that falls behind gets states, warnings and the newest
/// progress, sample and preview, and is told how many were left out.
class WatchHub {
public:
    WatchHub(JobRegistry& registry, const WatchOptions& options);
    WatchHub(const WatchHub&) = delete;
    WatchHub& operator=(const WatchHub&) = delete;
    ~WatchHub();

    /// Opens a stream for one call. The reactor deletes itself when the call is over.
    grpc::ServerWriteReactor<v1::JobEvent>* open(const v1::WatchJobRequest& request);
    /// Something changed about a job. Never blocks.
    void notify(const JobKey& key);
    /// Ends all streams, present and future, with UNAVAILABLE.
    void close();

private:
    friend class WatchStream;

    void wake(WatchStream* stream);
    void run(std::stop_token stop);
    void feed(WatchStream& stream);

    JobRegistry& registry_;
    const WatchOptions options_;

    std::mutex mutex_;
    std::condition_variable_any changed_;
    std::map<JobKey, std::set<WatchStream*>> streams_;  // needs mutex_
    std::set<WatchStream*> awake_;                      // needs mutex_
    std::size_t count_ = 0;                             // needs mutex_
    bool is_closed_ = false;                            // needs mutex_

    std::jthread thread_;
};

}  // namespace remesh
