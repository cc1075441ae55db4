#include "server/auth/gate.h"

#include <algorithm>
#include <array>
#include <utility>

namespace remesh {
namespace {

constexpr std::string_view kBearer = "Bearer ";
// Refusals are written down once in this time and counted otherwise: nobody outside can fill the
// disk.
constexpr std::chrono::seconds kRefusalInterval{1};

constexpr std::chrono::minutes kStrangerInterval{1};

AccessError stranger() {
    return {AccessErrorCode::Unauthenticated, "a valid token or client certificate is needed"};
}

constexpr std::array<std::string_view, 3> kRoleNames{"viewer", "user", "operator"};

}  // namespace

std::string Principal::actor() const {
    if (credential.empty()) {
        return "anonymous";
    }
    return (is_certificate ? "certificate:" : "token:") + credential;
}

bool is_name(std::string_view text) {
    return !text.empty() && text.size() <= 64 && std::all_of(text.begin(), text.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
    });
}

std::string_view role_name(Role role) {
    return kRoleNames[static_cast<std::size_t>(role)];
}

Role role_named(std::string_view name) {
    const auto* found = std::find(kRoleNames.begin(), kRoleNames.end(), name);
    if (found == kRoleNames.end()) {
        throw std::invalid_argument("a role must be viewer, user or operator, got \"" +
                                    std::string(name) + "\"");
    }
    return static_cast<Role>(found - kRoleNames.begin());
}

Gate::Gate(const std::filesystem::path& data_dir, bool requires_credentials, Clock clock)
    : access_(data_dir),
      audit_(data_dir),
      requires_credentials_(requires_credentials),
      clock_(clock ? std::move(clock) : system_now) {}

Principal Gate::admit(const Papers& papers, Role least, std::string_view action) {
    Principal who{std::string(kDefaultTenant), Role::Operator, {}, false};
    const bool shows_any = papers.authorization.has_value();
    if (const auto credential = credential_of(papers, clock_())) {
        who = {credential->tenant, credential->role, credential->id,
               credential->kind == Credential::Kind::Certificate};
    } else if (requires_credentials_ || shows_any) {
        note_refusal(papers, action, "UNAUTHENTICATED", {});
        throw stranger();
    }
    if (who.role < least) {
        note_refusal(papers, action, "PERMISSION_DENIED", who);
        throw AccessError(AccessErrorCode::Denied,
                          "this needs the role " + std::string(role_name(least)) +
                              ", the credential's is " + std::string(role_name(who.role)));
    }
    return who;
}

void Gate::require_acquaintance(const Papers& papers) {
    const Time now = clock_();
    if (credential_of(papers, now)) {
        return;
    }
    const std::scoped_lock lock(mutex_);
    const Time latest = now + kStrangers * kStrangerInterval;
    if (strangers_until_ > latest) {
        strangers_until_ = now;  // The clock was set back.
    }
    const Time next = std::max(strangers_until_, now) + kStrangerInterval;
    if (next > latest) {
        ++unwritten_refusals_;
        throw stranger();
    }
    strangers_until_ = next;
}

std::optional<Credential> Gate::credential_of(const Papers& papers, Time now) {
    if (papers.authorization) {
        const std::string_view header = *papers.authorization;
        return header.starts_with(kBearer) ? access_.find_token(header.substr(kBearer.size()), now)
                                           : std::nullopt;
    }
    return access_.find_certificate(papers.certificate_names, now);
}

bool Gate::is_still_valid(const Principal& who) {
    return who.credential.empty() || access_.is_valid(who.credential, clock_());
}

void Gate::note_refusal(const Papers& papers, std::string_view action, const std::string& outcome,
                        const Principal& who) {
    const Time now = clock_();
    std::int64_t others = 0;
    {
        const std::scoped_lock lock(mutex_);
        // A time before the last one is of a clock that was set back.
        if (last_refusal_ && now >= *last_refusal_ && now - *last_refusal_ < kRefusalInterval) {
            ++unwritten_refusals_;
            return;
        }
        last_refusal_ = now;
        others = std::exchange(unwritten_refusals_, 0);
    }
    record(who, papers.peer, action, others > 0 ? std::to_string(others) + " more before" : "",
           outcome);
}

void Gate::record(const Principal& who, const std::string& peer, std::string_view action,
                  const std::string& subject, const std::string& outcome) {
    audit_.append({clock_(), who.tenant, who.actor(), peer, std::string(action), subject, outcome});
}

}  // namespace remesh
