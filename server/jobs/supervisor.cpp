#include "server/jobs/supervisor.h"

#include <spdlog/spdlog.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <spawn.h>
#include <unistd.h>
#include <utility>

#include "server/store/digest.h"

namespace remesh {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kFirstWait{100};
// A worker that lived as long as this didn't fail at its start.
constexpr std::chrono::seconds kGoodLife{1};

/// In a new process no signal is blocked: the server's threads block those that end it.
class SpawnAttributes {
public:
    SpawnAttributes() {
        posix_spawnattr_init(&attributes_);
        sigset_t none;
        sigemptyset(&none);
        posix_spawnattr_setsigmask(&attributes_, &none);
        sigset_t all;
        sigfillset(&all);
        posix_spawnattr_setsigdefault(&attributes_, &all);
        posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    }
    SpawnAttributes(const SpawnAttributes&) = delete;
    SpawnAttributes& operator=(const SpawnAttributes&) = delete;
    ~SpawnAttributes() { posix_spawnattr_destroy(&attributes_); }

    [[nodiscard]] const posix_spawnattr_t* get() const { return &attributes_; }

private:
    posix_spawnattr_t attributes_{};
};

/// Waits until it has ended, and leaves it to be reaped: until then its number isn't given away.
siginfo_t wait_for_end(pid_t process) {
    siginfo_t end{};
    while (waitid(P_PID, static_cast<id_t>(process), &end, WEXITED | WNOWAIT) != 0 &&
           errno == EINTR) {
    }
    return end;
}

}  // namespace

Supervisor::Supervisor(const SupervisorOptions& options, OnEnd on_end)
    : options_(options), on_end_(std::move(on_end)) {
    for (int i = 0; i < options_.workers; ++i) {
        auto& slot = *slots_.emplace_back(std::make_unique<Slot>());
        slot.thread = std::jthread([this, &slot] { keep_running(slot); });
    }
}

Supervisor::~Supervisor() {
    drain();
    if (!wait_until_ended(std::chrono::seconds(1))) {
        kill_all();
    }
}

pid_t Supervisor::start(const std::string& worker) const {
    std::vector<std::string> words = options_.command;
    words.insert(words.end(), {"--worker-id", worker});
    std::vector<char*> arguments;
    for (std::string& word : words) {
        arguments.push_back(word.data());
    }
    arguments.push_back(nullptr);
    const SpawnAttributes attributes;
    pid_t process = 0;
    const int error =
        posix_spawn(&process, arguments[0], nullptr, attributes.get(), arguments.data(), environ);
    if (error != 0) {
        spdlog::error("event=worker_not_started message=\"{}\"", std::strerror(error));
        return 0;
    }
    return process;
}

// A worker is told to end when the thread that started it ends, so it's this one that waits.
void Supervisor::keep_running(Slot& slot) {
    milliseconds wait = kFirstWait;
    while (true) {
        const auto start_time = std::chrono::steady_clock::now();
        {
            const std::scoped_lock lock(mutex_);
            if (is_draining_) {
                return;
            }
            slot.worker = random_hex(8);
            slot.process = start(slot.worker);
        }
        if (slot.process != 0) {
            reap(slot, wait_for_end(slot.process));
        }
        const auto life = std::chrono::steady_clock::now() - start_time;
        wait = life >= kGoodLife ? kFirstWait : std::min(2 * wait, options_.longest_wait);
        std::unique_lock lock(mutex_);
        if (changed_.wait_for(lock, wait, [this] { return is_draining_; })) {
            return;
        }
    }
}

void Supervisor::reap(Slot& slot, const siginfo_t& end) {
    const bool is_exit = end.si_code == CLD_EXITED;
    const bool is_killed = [&] {
        const std::scoped_lock lock(mutex_);
        return slot.is_killed;
    }();
    const bool is_good = is_exit && end.si_status == 0;
    if (!is_good) {
        spdlog::warn("event=worker_ended worker={} {}={}", slot.worker, is_exit ? "exit" : "signal",
                     end.si_status);
    }
    on_end_(slot.worker, is_killed ? WorkerEnd::Killed
                         : is_good ? WorkerEnd::Stopped
                                   : WorkerEnd::Crashed);
    const std::scoped_lock lock(mutex_);
    waitpid(slot.process, nullptr, 0);
    slot.process = 0;
    changed_.notify_all();
}

void Supervisor::drain() {
    const std::scoped_lock lock(mutex_);
    is_draining_ = true;
    for (const auto& slot : slots_) {
        if (slot->process != 0) {
            ::kill(slot->process, SIGTERM);
        }
    }
    changed_.notify_all();
}

bool Supervisor::wait_until_ended(milliseconds timeout) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, timeout, [this] {
        return std::all_of(slots_.begin(), slots_.end(),
                           [](const auto& slot) { return slot->process == 0; });
    });
}

void Supervisor::kill_all() {
    {
        const std::scoped_lock lock(mutex_);
        for (const auto& slot : slots_) {
            if (slot->process != 0) {
                slot->is_killed = true;
                ::kill(slot->process, SIGKILL);
            }
        }
    }
    wait_until_ended(std::chrono::seconds(5));
}

}  // namespace remesh
