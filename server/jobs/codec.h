#pragma once

#include <string>
#include <string_view>

#include "server/jobs/job.h"

namespace remesh {

/// How specs, outcomes and events look in the store. The registry and the store never look inside.
class JobCodec {
public:
    JobCodec() = default;
    JobCodec(const JobCodec&) = delete;
    JobCodec& operator=(const JobCodec&) = delete;
    virtual ~JobCodec() = default;

    [[nodiscard]] virtual JobRequest decode_spec(std::string_view spec) const = 0;
    /// Equal for specs whose results are equal, of this version of the engine; empty: none are.
    [[nodiscard]] virtual std::string cache_key(std::string_view spec) const = 0;
    [[nodiscard]] virtual std::string encode_event(const JobEventBody& event) const = 0;
    /// Of what `encode_event` made of a Progress.
    [[nodiscard]] virtual Progress decode_progress(std::string_view event) const = 0;
    [[nodiscard]] virtual std::string encode_result(std::string_view spec,
                                                    const JobResult& result) const = 0;
    [[nodiscard]] virtual std::string encode_failure(const JobFailure& failure) const = 0;
};

}  // namespace remesh
