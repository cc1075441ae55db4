#pragma once

#include <atomic>
#include <memory>

#include "server/convert.h"
#include "server/executor.h"

namespace remesh {

/// Where calls wait that look into a file, which takes seconds: one looks at a time, and only so
/// many wait. Not with the others, whom they would hold up.
class InspectionQueue {
public:
    static constexpr int kMaxWaiting = 16;

    /// A call's place, held until its last copy is gone.
    class Place {
    public:
        explicit Place(InspectionQueue& queue)
            : is_good_(queue.waiting_.fetch_add(1) < kMaxWaiting),
              held_(nullptr, [&queue](void*) { --queue.waiting_; }) {}

        /// Whether there was one to have.
        [[nodiscard]] bool is_good() const { return is_good_; }
        /// \throws StatusError{RESOURCE_EXHAUSTED} if there was none
        void require() const {
            if (!is_good_) {
                throw StatusError(too_many_status(
                    "inspections", "at most 16 calls that look into files may wait at a time"));
            }
        }

    private:
        bool is_good_;
        std::shared_ptr<void> held_;
    };

    /// Where a call with this place runs; those without one are turned away by `other`.
    [[nodiscard]] Executor& executor(const Place& place, Executor& other) {
        return place.is_good() ? executor_ : other;
    }

private:
    std::atomic<int> waiting_ = 0;
    Executor executor_{1};
};

}  // namespace remesh
