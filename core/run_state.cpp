#include "core/run_state.h"

#include <algorithm>
#include <utility>

namespace remesh {
namespace {

// Times what a save took: it takes at most a twentieth of a run.
constexpr int kSaveShare = 20;

std::string_view bytes_of(const std::size_t& size) {
    return {reinterpret_cast<const char*>(&size), sizeof size};
}

}  // namespace

RunState::RunState(Save save, std::chrono::milliseconds interval)
    : save_(std::move(save)),
      interval_(interval),
      next_save_(std::chrono::steady_clock::now() + interval) {}

void RunState::resume(std::string_view saved) {
    StateReader from(saved);
    while (!from.is_at_end()) {
        std::vector<char> record;
        from.get(record);
        earlier_.emplace_back(record.begin(), record.end());
    }
}

std::string_view RunState::begin() {
    const std::size_t place = begun_++;
    return place < earlier_.size() ? std::string_view(earlier_[place]) : std::string_view();
}

void RunState::finish(std::string record) {
    present_.clear();
    if (finished_.size() < earlier_.size()) {
        earlier_[finished_.size()].clear();
    }
    finished_.push_back(std::move(record));
    if (is_due()) {
        save();
    }
}

void RunState::save() {
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::string_view> records(finished_.begin(), finished_.end());
    if (!present_.empty()) {
        records.push_back(present_);
    }
    // What the earlier run knew and this one hasn't come to yet.
    for (std::size_t i = records.size(); i < earlier_.size(); ++i) {
        records.push_back(earlier_[i]);
    }
    std::vector<std::size_t> sizes;
    sizes.reserve(records.size());
    std::vector<std::string_view> pieces;
    for (const std::string_view record : records) {
        pieces.push_back(bytes_of(sizes.emplace_back(record.size())));
        pieces.push_back(record);
    }
    if (!pieces.empty()) {
        save_(pieces);
    }
    present_.clear();  // its memory is worth more than a record that will soon be old
    const auto end = std::chrono::steady_clock::now();
    next_save_ =
        end + std::max<std::chrono::steady_clock::duration>(interval_, kSaveShare * (end - start));
}

}  // namespace remesh
