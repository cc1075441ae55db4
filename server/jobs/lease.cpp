#include <algorithm>
#include <iterator>
#include <utility>

#include "server/jobs/lease_desk.h"
#include "server/jobs/losses.h"

namespace remesh {
namespace {

// Previews of a running attempt that stay visible.
constexpr std::size_t kPreviewsKept = 8;

EventKind kind_of(const JobEventBody& event) {
    constexpr EventKind kinds[]{EventKind::Progress, EventKind::Sample, EventKind::Warning,
                                EventKind::Preview};
    return kinds[event.index()];
}

std::vector<ArtifactId> artifacts_of(const std::vector<JobOutput>& outputs) {
    std::vector<ArtifactId> artifacts;
    std::transform(outputs.begin(), outputs.end(), std::back_inserter(artifacts),
                   [](const JobOutput& output) { return output.artifact; });
    return artifacts;
}

}  // namespace

Lease::Lease(LeaseDesk& desk, std::shared_ptr<Attempt> attempt)
    : desk_(desk), attempt_(std::move(attempt)) {}

Lease::~Lease() {
    if (!is_settled_) {
        desk_.lose(*attempt_);
    }
    const std::scoped_lock lock(desk_.mutex_);
    --desk_.leases_;
    desk_.attempts_.notify_all();
}

bool Lease::is_giving_back() const {
    const std::scoped_lock lock(desk_.mutex_);
    return attempt_->stop_reason == Attempt::StopReason::Drain;
}

void Lease::publish(const JobEventBody& event) {
    NewEvent stored{kind_of(event), desk_.clock_(), desk_.codec_.encode_event(event)};
    const std::scoped_lock lock(desk_.mutex_);
    if (const auto* progress = std::get_if<Progress>(&event)) {
        attempt_->stage = progress->stage;
    }
    attempt_->pending.push_back(std::move(stored));
}

void Lease::publish_preview(ArtifactDraft draft, int iteration) {
    const ArtifactId artifact = draft.finish();
    const JobEventBody body = StoredPreview{artifact, iteration};
    std::vector<ArtifactDraft> drafts;
    drafts.push_back(std::move(draft));
    desk_.artifacts_.publish(std::move(drafts), [&] {
        desk_.flush(*attempt_,
                    {{EventKind::Preview, desk_.clock_(), desk_.codec_.encode_event(body)}},
                    {artifact});
    });
    previews_.push_back(artifact.sha256);
    if (previews_.size() > kPreviewsKept) {
        previews_.pop_front();
        const std::vector<std::string> keep(previews_.begin(), previews_.end());
        desk_.drop_previews(job().key, keep);
    }
}

std::optional<JobState> Lease::settle(const Verdict& verdict) {
    const auto ended = desk_.end(*attempt_, verdict);
    is_settled_ = true;
    return ended ? std::optional(ended->state) : std::nullopt;
}

std::optional<JobState> Lease::settle(const Settlement& settlement,
                                      std::vector<ArtifactDraft> outputs) {
    std::optional<JobState> state;
    desk_.artifacts_.publish(std::move(outputs), [&] {
        state = settle([&](const Claim& claim) {
            return desk_.store_.settle(claim, settlement, desk_.clock_());
        });
    });
    if (!previews_.empty()) {
        desk_.drop_previews(job().key, {});
    }
    return state;
}

std::optional<JobState> Lease::succeed(const JobResult& result,
                                       std::vector<ArtifactDraft> outputs) {
    return settle({.state = JobState::Succeeded,
                   .outcome = desk_.codec_.encode_result(job().spec, result),
                   .outputs = artifacts_of(result.outputs)},
                  std::move(outputs));
}

std::optional<JobState> Lease::fail(const JobFailure& failure, std::vector<ArtifactDraft> outputs) {
    return settle({.state = JobState::Failed,
                   .outcome = desk_.codec_.encode_failure(failure),
                   .outputs = artifacts_of(failure.outputs)},
                  std::move(outputs));
}

std::optional<JobState> Lease::stopped(Stage stage) {
    const auto reason = [&] {
        const std::scoped_lock lock(desk_.mutex_);
        return attempt_->stop_reason;
    }();
    if (const auto failure = desk_.failure_of(reason, stage)) {
        return settle(*failure, {});
    }
    const auto state =
        settle([&](const Claim& claim) { return desk_.store_.give_back(claim, desk_.clock_()); });
    if (!previews_.empty()) {
        desk_.drop_previews(job().key, {});
    }
    return state;
}

std::optional<JobState> Lease::postpone() {
    return settle([&](const Claim& claim) {
        const Time now = desk_.clock_();
        return desk_.store_.lose(claim, loss_of(job(), LossCause::Storage, desk_.codec_, now), now);
    });
}

}  // namespace remesh
