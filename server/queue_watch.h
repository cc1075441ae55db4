#pragma once

#include <grpcpp/support/server_callback.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <thread>

#include "remesh/v1/job.pb.h"
#include "server/auth/principal.h"
#include "server/executor.h"
#include "server/jobs/registry.h"
#include "server/watch_stream.h"

namespace remesh {

class QueueStream;

/// Feeds all WatchQueue streams from one thread.
///
/// A stream keeps the names of its tenant's jobs that changed and weren't sent, at most a thousand:
/// beyond that it forgets them and tells the reader to list anew. So a slow or dead reader costs
/// little, and a job that changes often is sent as it is when its turn comes.
class QueueHub {
public:
    /// Says whose queue may be watched, or why none may; may block.
    using Admission = std::function<grpc::Status(Principal&)>;

    /// \param options  as of WatchHub; queue watches have a bound of their own
    QueueHub(JobRegistry& registry, const WatchOptions& options, IsStillValid is_still_valid = {});
    QueueHub(const QueueHub&) = delete;
    QueueHub& operator=(const QueueHub&) = delete;
    ~QueueHub();

    /// Opens a stream for one call, once `admission` on the executor lets it. The reactor deletes
    /// itself when the call is over.
    grpc::ServerWriteReactor<v1::QueueEvent>* open(Executor& executor, Admission admission);
    /// Something changed about a job. Never blocks.
    void notify(const JobKey& key);
    /// Ends all streams, present and future, with UNAVAILABLE.
    void close();

private:
    friend class QueueStream;

    [[nodiscard]] grpc::Status start(QueueStream& stream, const Principal& who);
    void wake();
    /// A job in short, as it stood when it changed last or later. \throws JobError{NotFound}
    const v1::Job& short_of(const JobKey& key);
    /// Makes the next reader of a job that changed read it anew. Needs mutex_.
    void forget_changed();
    void run(std::stop_token stop);
    void feed(QueueStream& stream);
    /// The newest of the jobs that aren't done and weren't sent, or that these were all.
    v1::QueueEvent next_at_first(QueueStream& stream);
    /// What the reader should get next, if anything is due.
    std::optional<v1::QueueEvent> next(QueueStream& stream);
    void finish(QueueStream& stream, const grpc::Status& status);
    void write(QueueStream& stream, v1::QueueEvent event);

    JobRegistry& registry_;
    const WatchOptions options_;
    const IsStillValid is_still_valid_;
    TenantSlots slots_;

    std::mutex mutex_;
    std::condition_variable_any changed_;
    std::set<QueueStream*> streams_;  // needs mutex_
    bool is_awake_ = false;           // needs mutex_
    bool is_closed_ = false;          // needs mutex_
    std::set<JobKey> changed_jobs_;   // needs mutex_; since they were forgotten

    struct Told {
        v1::Job job{};
        std::chrono::steady_clock::time_point time{};
    };
    std::map<JobKey, Told> told_;  // the thread's only; of all tenants

    std::jthread thread_;
};

}  // namespace remesh
