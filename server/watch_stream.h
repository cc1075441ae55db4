#pragma once

#include <grpcpp/support/server_callback.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <stop_token>
#include <thread>

#include "server/auth/principal.h"
#include "server/executor.h"
#include "server/jobs/registry.h"
#include "server/tenant_slots.h"
#include "server/watch_news.h"

namespace remesh {

struct WatchOptions {
    int max_watches = 4'000;                      ///< More are refused.
    int max_watches_of_tenant = 2'000;            ///< More of one tenant, too.
    std::chrono::milliseconds heartbeat{15'000};  ///< Longest silence of a stream.
    std::int64_t max_backlog = 64;  ///< A reader further behind than this gets thinned samples.
    /// Of messages that tell a whole job and that aren't sent yet, each counted once however many
    /// get it. Watches that would need more end.
    std::int64_t max_bytes = std::int64_t{1} << 30;
    std::int64_t max_bytes_of_tenant = std::int64_t{256} << 20;  ///< Of one tenant's jobs.
};

/// What a stream was opened for.
struct WatchTarget {
    Principal who{};
    JobKey key{};
    std::int64_t after = 0;  ///< Only events after this sequence, >= 0.
};

/// Whether somebody who was let in still would be.
using IsStillValid = std::function<bool(const Principal&)>;

/// Asks, if `is_still_valid` is given and the last answer is older than `interval`.
/// \throws StatusError if who watches wouldn't be let in any more
void check_credential(const IsStillValid& is_still_valid, const Principal& who,
                      std::chrono::milliseconds interval,
                      std::chrono::steady_clock::time_point& last_check);

class WatchStream;

/// Feeds all WatchJob streams from one thread.
///
/// The store is the buffer: a stream is a cursor into its job's events with at most one message in
/// flight, so a slow or dead reader costs no memory. What was there when the stream opened is sent
/// in full; of what comes later, a reader that falls behind gets states, warnings and the newest
/// progress, sample and preview, and is told how many were left out. Whoever gets the same message
/// shares its bytes.
class WatchHub {
public:
    /// Says what may be watched, or why nothing may; may block.
    using Admission = std::function<grpc::Status(WatchTarget&)>;

    WatchHub(JobRegistry& registry, const WatchOptions& options, IsStillValid is_still_valid = {});
    WatchHub(const WatchHub&) = delete;
    WatchHub& operator=(const WatchHub&) = delete;
    ~WatchHub();

    /// Opens a stream for one call, once `admission` on the executor lets it. The reactor deletes
    /// itself when the call is over.
    grpc::ServerWriteReactor<grpc::ByteBuffer>* open(Executor& executor, Admission admission);
    /// Something changed about a job. Never blocks.
    void notify(const JobKey& key);
    /// Ends all streams, present and future, with UNAVAILABLE.
    void close();

private:
    friend class WatchStream;

    /// \throws JobError{NotFound}
    [[nodiscard]] grpc::Status start(WatchStream& stream, const WatchTarget& target);
    void wake(WatchStream* stream);
    void run(std::stop_token stop);
    void feed(WatchStream& stream);
    void finish(WatchStream& stream, const grpc::Status& status);
    void write(WatchStream& stream, WatchMessage message);

    JobRegistry& registry_;
    const WatchOptions options_;
    const IsStillValid is_still_valid_;
    TenantSlots slots_;
    TenantSlots bytes_;

    std::mutex mutex_;
    std::condition_variable_any changed_;
    std::map<JobKey, std::set<WatchStream*>> streams_;  // needs mutex_
    std::set<WatchStream*> awake_;                      // needs mutex_
    std::set<JobKey> changed_jobs_;                     // needs mutex_; watched ones
    bool is_closed_ = false;                            // needs mutex_

    WatchNews news_;  // the thread's only

    std::jthread thread_;
};

}  // namespace remesh
