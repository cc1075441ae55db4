#include "server/convert.h"
#include "server/convert/spec.h"
#include "server/convert/values.h"

namespace remesh {

v1::Job to_proto(const JobView& view) {
    const JobRecord& from = view.job;
    v1::Job to;
    if (!from.key.id.empty()) {
        to.set_name(job_name(from.key));
        to.set_etag(std::to_string(from.revision));
        to.set_state(to_proto(from.state));
        *to.mutable_create_time() = to_proto(from.create_time);
    }
    *to.mutable_spec() = parse_spec(from.spec);
    to.set_attempt(from.attempt);
    to.set_max_attempts(from.max_attempts);
    to.set_queue_position(static_cast<std::int32_t>(view.queue_position));
    if (from.state != JobState::Queued) {
        *to.mutable_progress() = to_proto(view.progress);
    }
    if (from.start_time) {
        *to.mutable_start_time() = to_proto(*from.start_time);
    }
    if (from.end_time) {
        *to.mutable_end_time() = to_proto(*from.end_time);
    }
    if (from.state == JobState::Succeeded) {
        to.mutable_result()->ParseFromString(from.outcome);
    } else if (from.state == JobState::Failed || from.state == JobState::Quarantined) {
        to.mutable_failure()->ParseFromString(from.outcome);
        to.mutable_progress()->set_stage(to.failure().stage());
    }
    to.set_last_sequence(from.last_sequence);
    if (!from.origin.empty()) {
        to.set_origin(job_name({from.key.tenant, from.origin}));
    }
    if (view.estimated_start) {
        *to.mutable_estimated_start_time() = to_proto(*view.estimated_start);
    }
    if (view.estimate) {
        to.mutable_estimate()->set_triangles(view.estimate->triangles);
        to.mutable_estimate()->set_tets(view.estimate->tets);
        to.mutable_estimate()->set_memory_bytes(view.estimate->memory_bytes);
        *to.mutable_estimate()->mutable_cpu_time() = duration_of(view.estimate->cpu_seconds);
    }
    return to;
}

v1::JobEvent to_proto(const StoredEvent& event, const JobView& job) {
    v1::JobEvent to;
    if (event.kind == EventKind::State) {
        JobView then = job;
        then.job.state = event.state;
        then.job.attempt = event.attempt;
        then.job.last_sequence = event.sequence;
        if (event.state == JobState::Running) {
            then.job.start_time = event.time;
        }
        if (!is_terminal(event.state)) {
            then.job.end_time.reset();
            then.progress = event.state == JobState::Running ? Progress{} : then.progress;
        }
        *(is_terminal(event.state) ? to.mutable_completed() : to.mutable_snapshot()) =
            to_proto(then);
    } else {
        to.ParseFromString(event.payload);
    }
    to.set_sequence(event.sequence);
    *to.mutable_time() = to_proto(event.time);
    return to;
}

}  // namespace remesh
