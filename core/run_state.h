#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/mesh/mesh.h"

namespace remesh {

/// What was kept of an earlier run is of another one: it can't be gone on with.
class StaleState : public std::runtime_error {
public:
    StaleState() : std::runtime_error("the state is of another run") {}
};

/// Values as bytes, one after the other: for this build on this machine.
class StateWriter {
public:
    template <typename T>
    void put(const T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    template <typename T>
    void put(const std::vector<T>& values) {
        static_assert(std::is_trivially_copyable_v<T> || std::is_same_v<T, Vec3>);
        put(values.size());
        bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    }
    [[nodiscard]] std::string take() { return std::move(bytes_); }

private:
    std::string bytes_;
};

/// Reads what a StateWriter wrote, in the same order.
class StateReader {
public:
    explicit StateReader(std::string_view bytes) : bytes_(bytes) {}

    /// \throws StaleState if nothing of that size is left
    template <typename T>
    void get(T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        std::memcpy(&value, next(sizeof value).data(), sizeof value);
    }
    /// Of any size. \throws StaleState
    template <typename T>
    void get(std::vector<T>& values) {
        static_assert(std::is_trivially_copyable_v<T> || std::is_same_v<T, Vec3>);
        std::size_t count = 0;
        get(count);
        if (count > bytes_.size() / sizeof(T)) {
            throw StaleState();
        }
        values.resize(count);
        const std::string_view bytes = next(count * sizeof(T));
        if (count > 0) {
            std::memcpy(static_cast<void*>(values.data()), bytes.data(), bytes.size());
        }
    }
    /// As many as there are. \throws StaleState if there were more or less
    template <typename T>
    void get_as_many(std::vector<T>& values) {
        const std::size_t count = values.size();
        get(values);
        if (values.size() != count) {
            throw StaleState();
        }
    }
    [[nodiscard]] bool is_at_end() const { return bytes_.empty(); }

private:
    std::string_view next(std::size_t size) {
        if (size > bytes_.size()) {
            throw StaleState();
        }
        const std::string_view bytes = bytes_.substr(0, size);
        bytes_.remove_prefix(size);
        return bytes;
    }

    std::string_view bytes_;
};

/// The state of a run's relaxations, for another run of the same input, options and build that
/// goes on from there and ends with the same bytes.
///
/// A run does its relaxations in an order that is always the same. Each is begun, keeps records of
/// itself at ends of iterations, and is finished by a last one. What lies between relaxations is
/// computed again from what they left. For the run's own thread.
class RunState {
public:
    /// Gets the pieces of what is to be saved.
    using Save = std::function<void(const std::vector<std::string_view>& pieces)>;

    /// Saves every `interval`, but so seldom that it takes at most a twentieth of the time.
    RunState(Save save, std::chrono::milliseconds interval);

    /// Makes the run go on from what an earlier one saved; to be called before it starts.
    /// \throws StaleState if it is malformed
    void resume(std::string_view saved);

    /// The next relaxation begins. \return the newest record of it by the earlier run, or empty
    [[nodiscard]] std::string_view begin();
    /// Takes a record of the present relaxation.
    void keep(std::string record) { present_ = std::move(record); }
    /// Takes its last one.
    void finish(std::string record);

    [[nodiscard]] bool is_due() const { return std::chrono::steady_clock::now() >= next_save_; }
    /// Saves all that is kept.
    void save();

private:
    Save save_;
    std::chrono::milliseconds interval_;
    std::chrono::steady_clock::time_point next_save_;
    std::vector<std::string> earlier_;  // a relaxation each
    std::size_t begun_ = 0;
    std::vector<std::string> finished_;
    std::string present_;
};

}  // namespace remesh
